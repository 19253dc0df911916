// The film follows the clock: it plays along, and is set right where it has drifted away.
const DRIFT = 0.12; // seconds of the film

export class Film {
  constructor(video, run, film) {
    this._video = video;
    this._rate = run.rate;
    video.hidden = !film;
    this._url = film ? URL.createObjectURL(new Blob([film], { type: "video/webm" })) : null;
    if (this._url) video.src = this._url;
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
    this._video.removeAttribute("src");
    this._video.load();
    if (this._url) URL.revokeObjectURL(this._url);
  }
}
