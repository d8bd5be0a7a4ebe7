// Plots over time alone: there is no motion beside them.
"use strict";

// A motion of which only the times are known.
class Clock extends Motion {
  read() {
    this.onPath = []; // there is no desired path
  }

  travel() {
    return this.times;
  }

  moment(time) {
    return this.timeText(time).slice(2);
  }
}

const data = JSON.parse(document.getElementById("data").textContent);
const clock = new Clock(data.clock, []);
clock.scale = clock.scales.time;
for (const figure of document.querySelectorAll("[data-chart]")) {
  const chart = data.charts.find((one) => one.id === figure.dataset.chart);
  new Plot(figure, chart, clock, []);
}
