// A live page: asks the server whether a file has changed, reloads when one has, and
// finds the moment and the point of view again.
"use strict";

(async function () {
  const { seen } = document.currentScript.dataset;
  const key = "vdsm-view";
  const note = document.querySelector("[data-lost]");
  const page = window.vdsm; // absent on a page that only says what is wrong
  const kept = JSON.parse(sessionStorage.getItem(key) || "null");
  if (page && kept) {
    page.motion.go(kept.time);
    if (page.view && kept.eye) page.view.lookFrom(kept.eye);
    if (kept.playing) page.motion.play(true);
  }

  function keep() {
    if (!page) return;
    const { time, playing } = page.motion;
    const eye = page.view ? page.view.eye() : null;
    sessionStorage.setItem(key, JSON.stringify({ time, playing, eye }));
  }

  for (;;) {
    try {
      const answer = await fetch(`changed?seen=${seen}`);
      note.hidden = true;
      if ((await answer.text()) !== "yes") continue;
      keep();
      location.reload();
      return;
    } catch {
      note.hidden = false;
      await new Promise((done) => setTimeout(done, 1000));
    }
  }
})();
