// Pictures of moments of the motion, written into the page for whoever opened it.
"use strict";

(function () {
  const { view, motion } = window.vdsm;
  const asked = JSON.parse(document.getElementById("asked").textContent);
  if (!view) return;
  view.resize();
  if (Array.isArray(asked.look)) {
    view.look("overview");
    view.cameras.fit(asked.look);
  } else view.look(asked.look);
  view.toggle("numbers", asked.numbers);
  const pictures = asked.moments.map((moment) => {
    motion.go(moment);
    return view.picture(asked.type, 0.92);
  });
  const told = document.createElement("pre");
  told.id = "pictures";
  told.textContent = pictures.join("\n");
  document.body.append(told);
})();
