// The time that everything on the page shows: runs at a speed, ends where the recording ends and begins again.
export class Clock {
  constructor() {
    this.speed = 1;
    this.playing = false;
    this.onchange = () => {};
    this.setTimes([0]);
  }

  setTimes(times) {
    this.times = times;
    this.time = times[0];
    this._last = null;
    this._set(false);
  }

  get frame() {
    // The last frame that has begun.
    let low = 0;
    let high = this.times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.times[middle] <= this.time + 1e-6) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  toggle() {
    if (!this.playing && this.frame === this.times.length - 1) this.time = this.times[0];
    this._set(!this.playing);
  }

  jump(frame) {
    this.time = this.times[Math.min(Math.max(frame, 0), this.times.length - 1)];
  }

  tick(now) {
    const passed = this._last === null ? 0 : (now - this._last) / 1000;
    this._last = now;
    if (!this.playing) return;
    const end = this.times[this.times.length - 1];
    this.time = Math.min(this.time + passed * this.speed, end);
    if (this.time >= end) this._set(false);
  }

  _set(playing) {
    this.playing = playing;
    this.onchange();
  }
}
