// The motion: joint values row by row, and the one moment that everything on the page
// shows. Time is counted in rows: 12.5 is half-way between rows 12 and 13.
"use strict";

function unpack(text, Type) {
  const bytes = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
  return new Type(bytes.buffer);
}

// Index of the last of some rising values that is not above one, and the share of the
// way to the next.
function between(values, value) {
  let low = 0;
  let high = values.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (values[middle] <= value) low = middle;
    else high = middle;
  }
  const step = values[high] - values[low];
  return [low, step > 0 ? (value - values[low]) / step : 0];
}

class Motion {
  constructor(data, lengths) {
    this.rows = unpack(data.rows, Int32Array);
    this.times = data.times ? unpack(data.times, Float64Array) : null; // of the rows [s]
    this.lengths = lengths;
    this.read(data);
    this.end = this.rows[this.rows.length - 1];
    this.time = 0;
    this.playing = false;
    this.seconds = Math.min(40, Math.max(8, data.nSamples / 40));
    this.speed = 1;
    this.listeners = [];
    this.scales = { waypoint: this.rows, travel: this.travel() };
    if (this.times) this.scales.time = this.times.map((time) => time - this.times[0]);
    this.scale = this.scales.waypoint;
  }

  // The joint values of an arm.
  read(data) {
    this.onPath = unpack(data.onPath, Uint8Array); // empty without a desired path
    this.pathM = unpack(data.pathM, Float32Array);
    this.x0 = unpack(data.x0, Float32Array);
    this.alpha = unpack(data.alpha, Float32Array);
    this.theta = unpack(data.theta, Float32Array);
    this.drawn = this.smooth(data.smooth) || this.asRows();
  }

  // What is drawn where straight lines join the rows.
  asRows() {
    return { moments: this.rows, x0: this.x0, alpha: this.alpha, theta: this.theta };
  }

  // Joint values between the rows where smooth pieces join them.
  smooth(data) {
    if (!data) return null;
    const [x0, alpha, theta] = [data.x0, data.alpha, data.theta].map((text) =>
      unpack(text, Float32Array));
    return { moments: unpack(data.moments, Float64Array), x0, alpha, theta };
  }

  // How far the tip has come at each row, detours included; [mm].
  travel() {
    const found = new Float32Array(this.rows.length);
    let before = null;
    this.rows.forEach((row, k) => {
      const tip = this.centres(row).at(-1);
      if (before)
        found[k] = found[k - 1] + 1000 * Math.hypot(...tip.map((v, i) => v - before[i]));
      before = tip;
    });
    return found;
  }

  // Where a moment stands on the axis of the plots, and back; 0 to 1.
  shareAt(time) {
    const [k, share] = this.place(time);
    const next = Math.min(k + 1, this.scale.length - 1);
    const value = this.scale[k] * (1 - share) + this.scale[next] * share;
    return value / (this.scale[this.scale.length - 1] || 1);
  }

  momentAt(share) {
    return this.momentOf(this.scale, share * this.scale[this.scale.length - 1]);
  }

  // The moment at which a scale has a value.
  momentOf(scale, value) {
    const [k, rest] = between(scale, Math.min(value, scale[scale.length - 1]));
    const next = Math.min(k + 1, this.rows.length - 1);
    return this.rows[k] * (1 - rest) + this.rows[next] * rest;
  }

  // Where the motion is some seconds later: by its own times, where it has any.
  later(seconds) {
    if (!this.times) return this.time + seconds * (this.end / this.seconds);
    return this.momentOf(this.times, this.timeNow() + seconds);
  }

  timeNow(time = this.time) {
    const [k, share] = this.place(time);
    const next = Math.min(k + 1, this.times.length - 1);
    return this.times[k] * (1 - share) + this.times[next] * share;
  }

  // Call `listener(time)` now and whenever the moment changes.
  listen(listener) {
    this.listeners.push(listener);
    listener(this.time);
  }

  go(time) {
    this.time = Math.min(this.end, Math.max(0, time));
    for (const listener of this.listeners) listener(this.time);
  }

  play(on) {
    if (on === this.playing) return;
    this.playing = on;
    if (on) {
      if (this.time >= this.end) this.time = 0;
      let before = performance.now();
      const tick = (now) => {
        if (!this.playing) return;
        const next = this.later((this.speed * Math.max(0, now - before)) / 1000);
        before = now;
        this.go(next);
        if (next >= this.end) this.play(false);
        else requestAnimationFrame(tick);
      };
      requestAnimationFrame(tick);
    }
    this.go(this.time);
  }

  // Index of the row shown at or before a time, and how far it is to the next.
  place(time) {
    return between(this.rows, time);
  }

  // A moment in waypoints.
  moment(time) {
    return time.toFixed(1);
  }

  // When a moment is, in words; nothing where nobody knows.
  timeText(time) {
    return this.times ? `, ${this.timeNow(time).toFixed(3)} s` : "";
  }

  // Joint centres O_1..O_{N+1} at a time.
  centres(time) {
    return this.poses(time)[0];
  }

  // The same, and the axes x, y, z of the base and of the links: rows are joined by
  // straight lines in joint space, as the proof has it, or by smooth pieces drawn as
  // short ones. Each link turns by yaw alpha, then by pitch theta.
  poses(time) {
    const { moments, x0, alpha, theta } = this.drawn;
    const [k, share] = between(moments, time);
    const n = this.lengths.length;
    const next = Math.min(k + 1, moments.length - 1);
    const mix = (values, i, size) =>
      values[k * size + i] * (1 - share) + values[next * size + i] * share;
    let [xx, xy, xz, yx, yy, yz, zx, zy, zz] = [1, 0, 0, 0, 1, 0, 0, 0, 1];
    const points = [[mix(x0, 0, 1), 0, 0]];
    const frames = [[xx, xy, xz, yx, yy, yz, zx, zy, zz]];
    for (let i = 0; i < n; i++) {
      const a = mix(alpha, i, n);
      const t = mix(theta, i, n);
      const [ca, sa, ct, st] = [Math.cos(a), Math.sin(a), Math.cos(t), Math.sin(t)];
      const [ux, uy, uz] = [ca * xx + sa * yx, ca * xy + sa * yy, ca * xz + sa * yz];
      [yx, yy, yz] = [ca * yx - sa * xx, ca * yy - sa * xy, ca * yz - sa * xz];
      [xx, xy, xz] = [ct * ux - st * zx, ct * uy - st * zy, ct * uz - st * zz];
      [zx, zy, zz] = [st * ux + ct * zx, st * uy + ct * zy, st * uz + ct * zz];
      const [px, py, pz] = points[i];
      const length = this.lengths[i];
      points.push([px + length * xx, py + length * xy, pz + length * xz]);
      frames.push([xx, xy, xz, yx, yy, yz, zx, zy, zz]);
    }
    return [points, frames];
  }

  // Stretches of time off the desired path, as [from, to].
  detours() {
    const found = [];
    for (let k = 0; this.onPath.length && k + 1 < this.rows.length; k++) {
      if (this.onPath[k] && this.onPath[k + 1]) continue;
      const last = found[found.length - 1];
      if (last && last[1] === this.rows[k]) last[1] = this.rows[k + 1];
      else found.push([this.rows[k], this.rows[k + 1]]);
    }
    return found;
  }
}
