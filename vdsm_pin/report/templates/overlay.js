// What is drawn flat over the picture: axes, scale, the gap as a dimension, numbers.
"use strict";

const BAR = 110; // pixels, about
const ARROW = 9;
const CROWD = 17; // pixels between two numbers, at least
const NARROW_GAP = 44; // pixels; below, the arrows of a dimension stand outside
const FONT = '600 13px system-ui, "DejaVu Sans", sans-serif';
const AXES = [["x", "#c92a2a"], ["y", "#2b8a3e"], ["z", "#1864ab"]];

// Rounded by `whole` to the safe side of what is proved; a millionth of a digit is noise.
function lengthText(metres, whole = Math.round) {
  const mm = whole(Math.round(metres * 1e12) / 1e6) / 1e3;
  const size = Math.abs(mm);
  const digits = size >= 1000 ? 1 : size >= 1e-3 || size === 0 ? 3 : -1;
  const text = digits < 0 ? mm.toExponential(1) : mm.toFixed(digits);
  return `${text.replace("-", "−")} mm`;
}

class Overlay {
  constructor(view) {
    this.view = view;
    this.sheet = document.createElement("canvas");
    this.sheet.className = "overlay";
    this.sheet.setAttribute("aria-hidden", "true");
    view.pane.appendChild(this.sheet);
    this.pen = this.sheet.getContext("2d");
    this.numbers = false;
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.view.pane;
    const fine = window.devicePixelRatio;
    [this.sheet.width, this.sheet.height] = [width * fine, height * fine];
    [this.width, this.height] = [width, height];
  }

  draw() {
    const style = getComputedStyle(this.view.pane);
    this.ink = style.getPropertyValue("--ink");
    this.card = style.getPropertyValue("--card");
    this.blue = style.getPropertyValue("--accent");
    this.red = style.getPropertyValue("--refuted");
    this.pen.setTransform(window.devicePixelRatio, 0, 0, window.devicePixelRatio, 0, 0);
    this.pen.clearRect(0, 0, this.width, this.height);
    this.triad();
    this.bar();
    if (this.numbers) this.linkNumbers();
    if (this.view.ghost) this.caption(this.view.ghost.words);
    if (this.view.due && measured(this.view.shown)) this.dimension(this.view.shown);
  }

  // Where a point of the base frame is seen, in pixels; null behind the camera.
  seen(point) {
    const { Vector3 } = MeshCat.THREE;
    const place = this.view.root.localToWorld(new Vector3(...point));
    place.project(this.view.cameras.camera);
    if (Math.abs(place.z) > 1) return null;
    return [((1 + place.x) * this.width) / 2, ((1 - place.y) * this.height) / 2];
  }

  text(words, x, y, colour, align = "left") {
    const pen = this.pen;
    [pen.font, pen.textAlign, pen.textBaseline] = [FONT, align, "middle"];
    [pen.lineWidth, pen.lineJoin, pen.strokeStyle] = [4, "round", this.card];
    pen.strokeText(words, x, y);
    pen.fillStyle = colour;
    pen.fillText(words, x, y);
  }

  line(colour, width, ...points) {
    const pen = this.pen;
    [pen.strokeStyle, pen.lineWidth] = [colour, width];
    pen.beginPath();
    points.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.stroke();
  }

  arrow(colour, [x, y], [dx, dy]) {
    const pen = this.pen;
    pen.fillStyle = colour;
    pen.beginPath();
    pen.moveTo(x, y);
    pen.lineTo(x - ARROW * dx + 0.4 * ARROW * dy, y - ARROW * dy - 0.4 * ARROW * dx);
    pen.lineTo(x - ARROW * dx - 0.4 * ARROW * dy, y - ARROW * dy + 0.4 * ARROW * dx);
    pen.fill();
  }

  // The axes of the problem file's frame.
  triad() {
    const { Vector3 } = MeshCat.THREE;
    const [left, low] = [44, this.height - 40];
    const turn = this.view.cameras.camera.matrixWorldInverse;
    const frame = this.view.viewer.scene.matrixWorld;
    const axes = AXES.map(([name, colour], k) => {
      const axis = new Vector3(+(k === 0), +(k === 1), +(k === 2));
      return { name, colour, axis: axis.transformDirection(frame).transformDirection(turn) };
    });
    for (const { name, colour, axis } of axes.sort((a, b) => a.axis.z - b.axis.z)) {
      const end = [left + 24 * axis.x, low - 24 * axis.y];
      this.line(colour, 2.5, [left, low], end);
      if (Math.hypot(axis.x, axis.y) > 0.2)
        this.text(name, left + 32 * axis.x, low - 32 * axis.y, colour, "center");
    }
  }

  // A length of 1, 2 or 5; where the picture is in perspective it holds at its middle.
  bar() {
    const { cameras } = this.view;
    if (cameras.name === "tip") return;
    const scale = cameras.scale;
    const length = niceStep(BAR * scale, 1.7);
    const [left, low, wide] = [92, this.height - 16, length / scale];
    this.line(this.ink, 2, [left, low - 5], [left, low], [left + wide, low], [left + wide, low - 5]);
    const mm = length * 1000;
    const about = cameras.camera === cameras.flat ? "" : "≈ ";
    const words = mm >= 1000 ? `${mm / 1000} m` : `${Number(mm.toPrecision(2))} mm`;
    this.text(about + words, left + wide / 2, low - 14, this.ink, "center");
  }

  linkNumbers() {
    const { centres } = this.view;
    let before = [-Infinity, 0];
    for (let i = 0; i + 1 < centres.length; i++) {
      const middle = centres[i].map((value, k) => (value + centres[i + 1][k]) / 2);
      const place = this.seen(middle);
      if (!place || Math.hypot(place[0] - before[0], place[1] - before[1]) < CROWD) continue;
      before = place;
      this.text(String(i + 1), ...place, this.ink, "center");
    }
  }

  // What the transparent arm is, in lines above the scale.
  caption(told) {
    const lines = told.flatMap((words) => this.wrapped(words, this.width - 32));
    lines.forEach((words, k) =>
      this.text(words, 16, this.height - 92 - 18 * (lines.length - 1 - k), this.red));
  }

  // Words in lines of at most so many pixels.
  wrapped(words, most) {
    this.pen.font = FONT;
    const lines = [];
    for (const word of words.split(" ")) {
      const longer = lines.length ? `${lines[lines.length - 1]} ${word}` : word;
      if (lines.length && this.pen.measureText(longer).width <= most) lines[lines.length - 1] = longer;
      else lines.push(word);
    }
    return lines;
  }

  // The gap between the two witness points, as on a drawing.
  dimension({ linkPoint, otherPoint, upper, deeper, short, nominal }) {
    const colour = short ? this.red : this.blue;
    const [a, b] = [this.seen(linkPoint), this.seen(otherPoint)];
    if (!a || !b) return;
    const size = Math.hypot(b[0] - a[0], b[1] - a[1]);
    const along = size > 1 ? [(b[0] - a[0]) / size, (b[1] - a[1]) / size] : [1, 0];
    const back = along.map((value) => -value);
    const out = size < NARROW_GAP ? 26 : 0;
    const outer = (p, way) => [p[0] - out * way[0], p[1] - out * way[1]];
    for (const [ink, width] of [[this.card, 5], [colour, 2]])
      this.line(ink, width, outer(a, along), outer(b, back));
    for (const [p, way] of [[a, along], [b, back]]) {
      this.arrow(colour, p, out ? way : way.map((value) => -value));
      const tick = [-8 * way[1], 8 * way[0]];
      this.line(colour, 2, [p[0] - tick[0], p[1] - tick[1]], [p[0] + tick[0], p[1] + tick[1]]);
    }
    const found = lengthText(upper, Math.ceil); // of two points: it is at most this
    const words = (deeper ? `${found} or deeper` : `at most ${found}`) + (nominal ? " without errors" : "");
    const middle = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
    const aside = along[0] >= 0 ? [along[1], -along[0]] : [-along[1], along[0]];
    this.pen.font = FONT;
    const half = this.pen.measureText(words).width / 2;
    const reach = 16 + Math.abs(aside[0]) * half;
    const across = Math.max(4 + half, Math.min(this.width - half - 4, middle[0] + reach * aside[0]));
    this.text(words, across, middle[1] + reach * aside[1], colour, "center");
  }
}
