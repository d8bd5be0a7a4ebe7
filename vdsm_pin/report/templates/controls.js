// Play button, slider, read-out, and what the view can be told to show.
"use strict";

function bindControls(motion, clearances) {
  const slider = document.querySelector("[data-slider]");
  const button = document.querySelector("[data-play]");
  const speed = document.querySelector("[data-speed]");
  slider.max = motion.end;
  slider.closest(".controls").classList.toggle("still", !motion.end);
  slider.addEventListener("input", () => {
    motion.play(false);
    motion.go(Number(slider.value));
  });
  button.addEventListener("click", () => motion.play(!motion.playing));
  speed.addEventListener("change", () => (motion.speed = Number(speed.value)));
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key === "?") return toggleKeys();
    const own = "button, a, summary, select, [type=checkbox], [type=range]:not([data-slider])";
    if (event.target.closest(own)) return; // these keys are theirs
    if (event.key === " ") motion.play(!motion.playing);
    else if (event.key === "ArrowRight") motion.go(Math.floor(motion.time) + 1);
    else if (event.key === "ArrowLeft") motion.go(Math.ceil(motion.time) - 1);
    else return;
    event.preventDefault();
  });
  document.querySelector("[data-keys]").addEventListener("click", toggleKeys);
  bindReadout(motion, slider, clearances);
  motion.listen((time) => {
    slider.value = time;
    button.textContent = motion.playing ? "❚❚ Pause" : "▶ Play";
    button.setAttribute("aria-pressed", String(motion.playing));
  });
}

// Show what keys do, or hide it.
function toggleKeys() {
  const list = document.getElementById("keys");
  list.hidden = !list.hidden;
  document.querySelector("[data-keys]").setAttribute("aria-expanded", String(!list.hidden));
}

// Where the motion is, and what clearance is proved there.
function bindReadout(motion, slider, clearances) {
  const moment = document.querySelector("[data-moment]");
  const clearance = document.querySelector("[data-clearance]");
  motion.listen((time) => {
    const [k] = motion.place(time);
    const where = motion.onPath[k]
      ? `, at ${(motion.pathM[k] * 1000).toFixed(0)} mm of the path`
      : ", off the path";
    const when = motion.timeText(time);
    const text = `waypoint ${time.toFixed(1)} of ${motion.end}${when}${motion.onPath.length ? where : ""}`;
    const near = clearances ? clearances.at(time) : { text: "", short: false };
    moment.textContent = text;
    clearance.textContent = near.text;
    clearance.classList.toggle("short", near.short);
    slider.setAttribute("aria-valuetext", [text, near.text].filter(Boolean).join("; "));
  });
}

// The clearance proved in each interval, as two of the plots have it.
class Clearances {
  constructor(charts, motion) {
    const of = (id) => charts.find((one) => one.id === id);
    this.motion = motion;
    this.required = of("clearance-link").limits[0].value;
    [this.links, this.obstacles] = ["clearance-link", "clearance-obstacle"].map((id) =>
      of(id).series.map(({ name, values, upper }) =>
        ({ name, values: unpack(values, Float32Array), upper: unpack(upper, Float32Array) })));
  }

  // The one with the least lower bound, or with the least upper one: that comes nearest.
  least(series, k, by = "value") {
    return series.reduce((best, one) => {
      const at = Math.min(k, one.values.length - 1);
      const found = { name: one.name, value: one.values[at], upper: one.upper[at] };
      return best === null || found[by] < best[by] ? found : best;
    }, null);
  }

  at(time) {
    const [k] = this.motion.place(time);
    const [link, obstacle] = [this.least(this.links, k), this.least(this.obstacles, k)];
    const short = !(link.value >= this.required);
    if (!Number.isFinite(link.value)) return { text: "clearance not known here", short };
    const known = Math.abs(obstacle.value - link.value) < 1e-3;
    const meets = link.value <= 0 && link.upper < 2e-6;  // [mm]: contact is found, and no depth
    if (link.value < 0 || meets) {
      return { text: `${link.name} ${meets ? "meets" : "may meet"} ${known ? obstacle.name : "an obstacle"}`, short };
    }
    // What is far is bounded roughly: its lower bound may be less than that of the nearest.
    const [near, other] = [this.least(this.links, k, "upper"), this.least(this.obstacles, k, "upper")];
    const from = Math.abs(near.upper - other.upper) < 1e-3 ? ` from ${other.name}` : "";
    return { text: `${near.name}${from}: at least ${lengthText(link.value / 1000, Math.floor)}`, short };
  }
}

function clearancesOf(charts, motion) {
  return charts.some((one) => one.id === "clearance-link") ? new Clearances(charts, motion) : null;
}

function bindView(view, title) {
  for (const button of document.querySelectorAll("[data-look]"))
    button.addEventListener("click", () => view.look(button.dataset.look));
  const looking = (view.scene.links || []).some((link) => (link.looks || []).length);
  for (const row of document.querySelectorAll("[data-solids]")) row.hidden = !looking;
  for (const box of document.querySelectorAll("[data-toggle]"))
    box.addEventListener("change", () => view.toggle(box.dataset.toggle, box.checked));
  document.querySelector("[data-save]").addEventListener("click", () => {
    const link = document.createElement("a");
    link.href = view.picture();
    link.download = `${title.replace(/[^\p{L}\p{N}]+/gu, "-")}-${view.motion.time.toFixed(1)}.png`;
    link.click();
  });
  if (!view.obstacles.length) return; // nothing to cut, nothing to hide
  bindSection(view);
  bindObstacles(view);
}

// A section: across which axis, where, and which half stays.
function bindSection(view) {
  const [axis, place, flip, read] = ["axis", "place", "flip", "read"].map((name) =>
    document.querySelector(`[data-section=${name}]`));
  let beyond = true;
  const cut = () => {
    const off = axis.value === "";
    place.disabled = flip.disabled = off;
    read.textContent = off ? "" : `${"xyz"[axis.value]} = ${(1000 * place.value).toFixed(0)} mm`;
    if (off) view.section.off();
    else view.section.cut(Number(axis.value), Number(place.value), beyond);
  };
  axis.addEventListener("change", () => {
    if (axis.value !== "") {
      const [low, high] = view.section.span(Number(axis.value));
      [place.min, place.max, place.value] = [low, high, (low + high) / 2];
      beyond = !view.section.cameraBeyond(Number(axis.value), (low + high) / 2);
    }
    cut();
  });
  place.addEventListener("input", cut);
  flip.addEventListener("click", () => {
    beyond = !beyond;
    cut();
  });
  view.recut = cut;
}

// The list of obstacles, made when it is opened: a scene may have two thousand.
function bindObstacles(view) {
  const list = document.querySelector("[data-obstacles]");
  const all = list.querySelector("select");
  const choices = all.innerHTML;
  const apply = (body, look) => {
    showObstacle(body, look);
    view.viewer.set_dirty();
  };
  list.addEventListener("toggle", () => {
    const rows = list.querySelector("[data-rows]");
    if (rows.childElementCount) return;
    view.scene.obstacles.forEach((solid, k) => {
      const row = document.createElement("label");
      row.innerHTML = `<span class="name"></span> <select>${choices}</select>`;
      row.firstChild.textContent = solid.name;
      row.querySelector("select").value = all.value;
      row.querySelector("select").addEventListener("change", (event) => {
        apply(view.obstacles[k], event.target.value);
        view.recut();
      });
      rows.append(row);
    });
  });
  all.addEventListener("change", () => {
    view.obstacles.forEach((body) => apply(body, all.value));
    list.querySelectorAll("[data-rows] select").forEach((one) => (one.value = all.value));
    view.recut();
  });
}
