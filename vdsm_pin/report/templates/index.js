// Sorting and filtering of the table of problems; durations come from timing.js.
"use strict";

(function () {
  const body = document.querySelector("#problems tbody");
  const rows = [...body.rows];
  const seconds = window.vdsmTiming || {};
  for (const row of rows) {
    const cell = row.querySelector("[data-time]");
    const value = seconds[row.dataset.folder];
    if (value === undefined) continue;
    cell.dataset.key = value;
    cell.textContent = `${value.toFixed(2)} s`;
  }

  // Numbers before words, missing values last whatever the direction.
  function compare(a, b) {
    if (a === "" || b === "") return a === b ? 0 : a === "" ? Infinity : -Infinity;
    const [x, y] = [Number(a), Number(b)];
    if (!Number.isNaN(x) && !Number.isNaN(y)) return x - y;
    return a.localeCompare(b, "en", { numeric: true });
  }

  for (const button of document.querySelectorAll("[data-sort]"))
    button.addEventListener("click", () => {
      const heading = button.parentElement;
      const up = heading.getAttribute("aria-sort") !== "ascending";
      for (const other of heading.parentElement.children)
        if (other.hasAttribute("aria-sort")) other.setAttribute("aria-sort", "none");
      heading.setAttribute("aria-sort", up ? "ascending" : "descending");
      const column = Number(button.dataset.sort);
      const keyed = rows.map((row) => [row.cells[column].dataset.key, row]);
      keyed.sort(([a], [b]) => {
        const order = compare(a, b);
        return Number.isFinite(order) && !up ? -order : order;
      });
      body.append(...keyed.map(([, row]) => row));
    });

  for (const button of document.querySelectorAll("[data-only]"))
    button.addEventListener("click", () => {
      for (const other of document.querySelectorAll("[data-only]"))
        other.setAttribute("aria-pressed", String(other === button));
      const only = button.dataset.only;
      for (const row of rows) row.hidden = only !== "" && row.dataset.outcome !== only;
    });
})();
