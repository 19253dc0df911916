// The film follows the clock: it plays along, and is set right where it has drifted away.
const DRIFT = 0.12; // seconds of the film

export class Film {
  constructor(video, run, film, poster) {
    this._video = video;
    this._rate = run.rate;
    video.hidden = !film;
    if (!film) return;
    this._url = URL.createObjectURL(new Blob([film], { type: "video/webm" }));
    this._poster = URL.createObjectURL(new Blob([poster], { type: "image/jpeg" }));
    [video.poster, video.src] = [this._poster, this._url];
  }

  follow(clock) {
    if (!this._url || this._video.readyState < 1) return;
    const wanted = (clock.frame + 0.5) / this._rate;
    const apart = Math.abs(this._video.currentTime - wanted);
    if (clock.playing) {
      this._video.playbackRate = clock.speed;
      if (this._video.paused) this._video.play().catch(() => {});
    } else if (!this._video.paused) this._video.pause();
    const allowed = clock.playing ? DRIFT * Math.max(1, clock.speed) : 0.4 / this._rate;
    if (apart > allowed && !this._video.seeking) this._video.currentTime = wanted;
  }

  dispose() {
    this._video.pause();
    for (const name of ["src", "poster"]) this._video.removeAttribute(name);
    this._video.load();
    for (const url of [this._url, this._poster]) if (url) URL.revokeObjectURL(url);
  }
}
