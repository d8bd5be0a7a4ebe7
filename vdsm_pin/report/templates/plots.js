// Plots against the row number as SVG: axes, limits, shaded detours, a cursor that
// follows the motion, values of every series in the legend.
"use strict";

const SVG = "http://www.w3.org/2000/svg";
const MOST_CHIPS = 60; // more names than that help nobody
const LONG_NAME = 26; // letters of a name in the legend; longer ones are broken
const TICK_GAP = 13;
const NARROW = window.innerWidth <= 700; // a plot is as wide as its figures stay legible
const FRAME = { width: NARROW ? 420 : 640, height: 232, left: 58, right: 14, top: 12, bottom: 34 };

function element(name, attributes, parent, text) {
  const node = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (text !== undefined) node.textContent = text;
  if (parent) parent.appendChild(node);
  return node;
}

// Round steps: 1, 2, 5, 10, .. so that about `count` fit into a span.
function niceStep(span, count) {
  const raw = span / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  return power * [1, 2, 5, 10].find((step) => step * power >= raw * 0.999);
}

function ticks(low, high, count) {
  const step = niceStep(high - low || 1, count);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++)
    found.push(k * step);
  return found;
}

// Ticks of a curved scale: powers of ten, with 2 and 5 where those are too few, else
// equal steps. `apart` keeps those that do not crowd.
function curvedTicks(low, high, apart) {
  const of = (steps) => {
    const found = [0];
    for (let power = 0.01; power <= 1e5; power *= 10)
      for (const step of steps) found.push(step * power, -step * power);
    return found.map((value) => Number(value.toPrecision(3)));
  };
  const inside = (value) => value >= low && value <= high;
  const tens = of([1]).filter((value) => !value || Math.abs(value) >= 1);
  const even = [5, 8, 12].map((count) => ticks(low, high, count));
  const found = [tens, of([1, 2, 5]), ...even].map((some) => apart(some.filter(inside)));
  return found.find((some) => some.length >= 3) || found[found.length - 1];
}

function shortNumber(value) {
  const text = String(Number(value.toPrecision(6)));
  return text.replace("-", "−");
}

class Plot {
  constructor(figure, chart, motion, marks) {
    this.chart = chart;
    this.marks = marks;
    this.motion = motion;
    this.isolated = null;
    this.series = chart.series.map((one) => ({
      ...one,
      values: unpack(one.values, Float32Array),
      upper: one.upper ? unpack(one.upper, Float32Array) : null,
    }));
    this.warp = chart.scale === "asinh" ? Math.asinh : (value) => value;
    this.range();
    this.draw(figure);
    this.legend(figure);
    motion.listen((time) => this.cursor(time));
  }

  redraw() {
    const place = this.svg.parentNode;
    this.svg.remove();
    this.draw(place.parentNode);
    this.isolate(this.isolated);
    this.cursor(this.motion.time);
  }

  // Lowest and highest value shown; far limits are left out, near ones are kept in.
  range() {
    let [low, high] = [Infinity, -Infinity];
    for (const { values, upper } of this.series)
      for (const list of upper ? [values, upper] : [values])
        for (const value of list)
          if (Number.isFinite(value)) {
            low = Math.min(low, value);
            high = Math.max(high, value);
          }
    if (low > high) [low, high] = [0, 1];
    const span = high - low;
    this.limits = this.chart.limits.filter(
      ({ value }) =>
        !this.chart.far_limits || (value > low - span / 2 && value < high + span / 2),
    );
    for (const { value } of this.limits) {
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
    if (this.chart.floor !== undefined) low = Math.min(low, this.chart.floor);
    const margin = (this.warp(high) - this.warp(low)) * 0.06 || 1;
    this.low = this.warp(low) - (low === this.chart.floor ? 0 : margin);
    this.high = this.warp(high) + margin;
    [this.lowest, this.highest] = [low, high];
  }

  x(time) {
    const inner = FRAME.width - FRAME.left - FRAME.right;
    return FRAME.left + inner * this.motion.shareAt(time);
  }

  y(value) {
    const inner = FRAME.height - FRAME.top - FRAME.bottom;
    const share = (this.warp(value) - this.low) / (this.high - this.low);
    return FRAME.height - FRAME.bottom - inner * share;
  }

  draw(figure) {
    const { width, height, left, right, top, bottom } = FRAME;
    const label = `${this.chart.title} against ${this.along}; ${this.chart.note}`;
    this.svg = element("svg", {
      viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": label, class: "plot",
    });
    figure.querySelector("[data-plot]").appendChild(this.svg);
    for (const [from, to] of this.motion.detours())
      element("rect", {
        x: this.x(from), width: Math.max(1, this.x(to) - this.x(from)),
        y: top, height: height - top - bottom, class: "detour",
      }, this.svg);
    this.axes();
    for (const { value, label: text } of this.limits) this.limit(value, text);
    this.lines = this.series.map((one) => this.line(one));
    // The one that decided comes first; drawn last, it is not covered.
    for (const mark of [...this.marks].reverse()) this.mark(mark);
    this.rule = element("line", { y1: top, y2: height - bottom, class: "cursor" }, this.svg);
    this.tip = element("g", { class: "hover", visibility: "hidden" }, this.svg);
    element("rect", { rx: 4, height: 20, y: -10 }, this.tip);
    element("text", { y: 4, x: 6 }, this.tip);
    this.dot = element("circle", { r: 3.5, visibility: "hidden", class: "dot" }, this.svg);
    this.right = width - right;
    this.bind();
  }

  get along() {
    const { scale, scales } = this.motion;
    if (scale === scales.time) return "time from the start [s]";
    return scale === scales.travel ? "way of the tip [mm]" : "waypoint";
  }

  axes() {
    const { width, height, left, right, top, bottom } = FRAME;
    const values = this.chart.scale === "asinh"
      ? curvedTicks(this.lowest, this.highest, (some) => this.apart(some))
      : ticks(this.lowest, this.highest, 5).filter((v) => !this.chart.whole || v % 1 === 0);
    for (const value of values) {
      const y = this.y(value);
      element("line", { x1: left, x2: width - right, y1: y, y2: y, class: "grid" }, this.svg);
      element("text", { x: left - 6, y: y + 4, class: "tick end" }, this.svg, shortNumber(value));
    }
    const { scale, scales } = this.motion;
    const end = scale[scale.length - 1] || 1;
    const whole = scale === scales.waypoint;
    for (const value of ticks(0, end, NARROW ? 4 : 8).filter((t) => !whole || t % 1 === 0)) {
      const x = left + ((width - left - right) * value) / end;
      element("line", { x1: x, x2: x, y1: height - bottom, y2: height - bottom + 4, class: "axis" }, this.svg);
      element("text", { x, y: height - bottom + 16, class: "tick middle" }, this.svg, Number(value.toPrecision(6)));
    }
    element("line", { x1: left, x2: left, y1: top, y2: height - bottom, class: "axis" }, this.svg);
    element("line", { x1: left, x2: width - right, y1: height - bottom, y2: height - bottom, class: "axis" }, this.svg);
    element("text", { x: (left + width - right) / 2, y: height - 3, class: "label middle" }, this.svg, this.along);
    const turn = `translate(13 ${(top + height - bottom) / 2}) rotate(-90)`;
    element("text", { transform: turn, class: "label middle" }, this.svg, this.chart.axis);
  }

  // Those of some values whose ticks do not crowd, the smallest first.
  apart(values) {
    const kept = [];
    for (const value of values.sort((a, b) => Math.abs(a) - Math.abs(b)))
      if (kept.every((other) => Math.abs(this.y(other) - this.y(value)) >= TICK_GAP))
        kept.push(value);
    return kept;
  }

  limit(value, text) {
    const y = this.y(value);
    const end = FRAME.width - FRAME.right;
    element("line", { x1: FRAME.left, x2: end, y1: y, y2: y, class: "limit" }, this.svg);
    const up = y > FRAME.top + 14;
    element("text", { x: end - 4, y: up ? y - 4 : y + 13, class: "limit-text end" }, this.svg, text);
  }

  // Where a check failed: a line through the plot with a flag on top.
  mark({ moment, verdict, name }) {
    const x = this.x(moment);
    const group = element("g", {}, this.svg);
    element("title", {}, group, `${name}: ${verdict} at waypoint ${moment.toFixed(2)}`);
    const ends = { x1: x, x2: x, y1: FRAME.top, y2: FRAME.height - FRAME.bottom };
    element("line", { ...ends, class: `mark ${verdict}` }, group);
    const flag = `M${x - 6} ${FRAME.top - 10}h12l-6 10z`;
    element("path", { d: flag, class: `flag ${verdict}` }, group);
  }

  path(values, step) {
    const rows = this.motion.rows;
    let text = "";
    let pen = "M";
    for (let k = 0; k < values.length; k++) {
      if (!Number.isFinite(values[k])) {
        pen = "M";
        continue;
      }
      const y = this.y(values[k]).toFixed(1);
      text += `${pen}${this.x(rows[k]).toFixed(1)} ${y}`;
      if (step && k + 1 < rows.length) text += `H${this.x(rows[k + 1]).toFixed(1)}`;
      pen = "L";
    }
    return text;
  }

  line(one) {
    const group = element("g", { style: `stroke:${one.colour}`, class: "series" }, this.svg);
    if (one.upper)
      element("path", { d: this.path(one.upper, one.step), class: "upper" }, group);
    const dash = one.dash ? { "stroke-dasharray": one.dash } : {};
    element("path", { d: this.path(one.values, one.step), ...dash }, group);
    if (this.motion.rows.length === 1 && Number.isFinite(one.values[0])) {
      const place = { cx: this.x(0), cy: this.y(one.values[0]), r: 4 };
      element("circle", { ...place, style: `fill:${one.colour}` }, group);
    }
    return group;
  }

  legend(figure) {
    const list = figure.querySelector("[data-legend]");
    const [name, value] = [this.series.map((one) => one.name),
      [this.lowest, this.highest].map((extreme) => this.text(extreme))]
      .map((texts) => Math.max(...texts.map((text) => text.length)));
    list.style.setProperty("--chip", `${Math.min(name, LONG_NAME) + value}ch`);
    list.classList.toggle("long", this.series.length > 24);
    if (this.series.length > MOST_CHIPS) {
      const note = list.appendChild(document.createElement("p"));
      note.textContent = `${this.series.length} curves; the nearest is named under the pointer`;
      this.chips = [];
      return;
    }
    this.chips = this.series.map((one, i) => {
      const chip = document.createElement("button");
      chip.type = "button";
      chip.title = `Show only ${one.name}`;
      chip.setAttribute("aria-pressed", "false");
      chip.innerHTML = '<i></i><span class="name"></span> <output></output>';
      chip.querySelector("i").style.background = one.colour;
      chip.querySelector(".name").textContent = one.name;
      chip.addEventListener("click", () => this.isolate(this.isolated === i ? null : i));
      list.appendChild(chip);
      return chip;
    });
  }

  isolate(index) {
    this.isolated = index;
    this.lines.forEach((line, i) =>
      line.classList.toggle("faint", index !== null && index !== i));
    this.chips.forEach((chip, i) => chip.setAttribute("aria-pressed", String(index === i)));
  }

  // Value of a series at a time: between rows on the line, in a step the step's.
  value(one, time) {
    const [k, share] = this.motion.place(time);
    const last = one.values.length - 1;
    if (one.step) return one.values[Math.min(k, last)];
    const next = Math.min(k + 1, last);
    return one.values[k] * (1 - share) + one.values[next] * share;
  }

  // A bound is rounded to its safe side: no more is told than is proved.
  text(value, round) {
    if (!Number.isFinite(value)) return "not available";
    const digits = this.chart.whole ? 0 : 2;
    const told = round ? round(Math.round(value * 1e6) / 1e4) / 1e2 : value;
    const text = told.toFixed(digits).replace(/^-(?=[0.]*$)/, "").replace("-", "−");
    return text + this.chart.unit;
  }

  told(one, time) {
    const value = this.value(one, time);
    const text = this.text(value, one.step && Math.floor);
    const upper = one.upper?.[Math.min(this.motion.place(time)[0], one.upper.length - 1)];
    if (!(value < 0) || !Number.isFinite(upper)) return text; // below zero it may be rough
    return `${text.replace(this.chart.unit, "")} to ${this.text(upper, Math.ceil)}`;
  }

  cursor(time) {
    const x = this.x(time);
    this.rule.setAttribute("x1", x);
    this.rule.setAttribute("x2", x);
    this.chips.forEach((chip, i) => {
      chip.querySelector("output").textContent = this.told(this.series[i], time);
    });
  }

  bind() {
    const at = (event) => {
      const box = this.svg.getBoundingClientRect();
      const scale = FRAME.width / box.width;
      const inner = FRAME.width - FRAME.left - FRAME.right;
      const x = (event.clientX - box.left) * scale;
      const share = Math.min(1, Math.max(0, (x - FRAME.left) / inner));
      return [this.motion.momentAt(share), (event.clientY - box.top) * scale];
    };
    this.svg.addEventListener("pointerdown", (event) => {
      this.svg.setPointerCapture(event.pointerId);
      this.motion.play(false);
      this.motion.go(at(event)[0]);
    });
    this.svg.addEventListener("pointermove", (event) => {
      const [time, y] = at(event);
      if (event.buttons) this.motion.go(time);
      this.hover(time, y);
    });
    this.svg.addEventListener("pointerleave", () => {
      this.tip.setAttribute("visibility", "hidden");
      this.dot.setAttribute("visibility", "hidden");
    });
  }

  // Name the series nearest to the pointer.
  hover(time, y) {
    let best = null;
    this.series.forEach((one, i) => {
      if (this.isolated !== null && this.isolated !== i) return;
      const value = this.value(one, time);
      const gap = Math.abs(this.y(value) - y);
      if (Number.isFinite(value) && (!best || gap < best.gap)) best = { one, value, gap };
    });
    if (!best) return;
    const x = this.x(time);
    const level = this.y(best.value);
    const text = this.tip.querySelector("text");
    text.textContent = `${best.one.name}: ${this.told(best.one, time)} at ${this.motion.moment(time)}`;
    const width = text.getComputedTextLength() + 12;
    this.tip.querySelector("rect").setAttribute("width", width);
    const left = x + width + 12 > this.right ? x - width - 8 : x + 8;
    const height = Math.min(Math.max(level - 14, FRAME.top + 10), FRAME.height - FRAME.bottom - 10);
    this.tip.setAttribute("transform", `translate(${left} ${height})`);
    this.dot.setAttribute("cx", x);
    this.dot.setAttribute("cy", level);
    this.dot.style.fill = best.one.colour;
    for (const node of [this.tip, this.dot]) node.setAttribute("visibility", "visible");
  }
}
