// Puts a page together: data, motion, 3D view, plots, buttons.
"use strict";

(function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  const Kind = data.scene.links ? LinkMotion : Motion;
  const motion = new Kind(data.motion, data.scene.lengths);
  const pane = document.getElementById("view");
  const view = makeView(pane, data.scene, motion);
  bindControls(motion, clearancesOf(data.charts, motion));
  if (view) bindView(view, document.title);

  const figures = document.querySelectorAll("[data-chart]");
  const plots = [...figures].map((figure) => {
    const chart = data.charts.find((one) => one.id === figure.dataset.chart);
    return new Plot(figure, chart, motion, data.marks);
  });

  let started = false;
  function reveal(button) {
    if (started && button.dataset.scroll !== undefined)
      pane.scrollIntoView({ behavior: "smooth", block: "center" });
  }

  // Go to a moment; where two bodies come near each other then, show how near and,
  // once the page has been seen as a whole, fly there.
  function jump(button, moment, approach) {
    motion.play(false);
    motion.go(moment);
    if (view && approach) view.showWitness(approach);
    if (view && approach && started) view.flyToWitness();
    reveal(button);
  }
  for (const button of document.querySelectorAll("[data-approach]"))
    button.addEventListener("click", () => {
      const approach = data.closest[Number(button.dataset.approach)];
      jump(button, approach.moment, approach);
    });
  for (const button of document.querySelectorAll("[data-go]"))
    button.addEventListener("click", () => {
      const moment = Number(button.dataset.go);
      jump(button, moment, data.closest.find((one) => Math.abs(one.moment - moment) < 0.01));
    });
  const along = document.querySelector("[data-along]");
  if (along)
    along.addEventListener("change", () => {
      motion.scale = motion.scales[along.value];
      plots.forEach((plot) => plot.redraw());
    });

  // Paper has no WebGL: a still picture takes the canvas's place.
  window.addEventListener("beforeprint", () => {
    const still = document.getElementById("still");
    if (view && still) still.src = view.picture();
    document.querySelectorAll("details").forEach((one) => (one.open = true));
  });

  // Begin where the verdict was decided, else where the arm comes nearest.
  const worst = document.querySelector("[data-worst]");
  if (worst) worst.click();
  const first = document.querySelector("[data-first]");
  if (first) first.click();
  if (view && !worst && data.closest.length) view.showWitness(data.closest[0]);
  started = true;
  window.vdsm = { motion, view, plots, data };
})();
