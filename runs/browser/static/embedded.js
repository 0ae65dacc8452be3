"use strict";
// Where data come from: this file. Details of points stand in compressed blocks, each read when it is first needed.

// The blocks stand behind all else, so that figures need not wait for them.
const whole = new Promise((read) => document.addEventListener("DOMContentLoaded", read));

async function readDetails(run) {
  await whole;
  const place = byId(`block-${run.block}`);
  if (!place) throw new Error("it is not in this file");
  if (!("DecompressionStream" in window)) throw new Error("this browser is too old: it cannot decompress data");
  const bytes = Uint8Array.from(atob(place.textContent), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).json();
}

/**
 * Have the drawing package read and compiled as a script of its own, beside this page; then draw. Handed over at once, it is read before the
 * page counts as loaded, so that programs that print pages wait for it.
 */
function readPackage() {
  const address = URL.createObjectURL(new Blob([byId("package").textContent], { type: "text/javascript" }));
  const failed = () => fill(byId("plot-note"), element("span", { class: "warning" }, "The drawing package cannot be read: there are no figures."));
  const script = element("script", { src: address, onload: drawFigures, onerror: failed });
  // A copy of the page that the browser saves must not have this address.
  for (const end of ["load", "error"]) script.addEventListener(end, () => { script.remove(); URL.revokeObjectURL(address); });
  document.head.append(script);
  // The graphics card is made ready in the meantime, once the table has been seen.
  if (state.points.length > MANY) requestAnimationFrame(() => setTimeout(hasGl));
}

begin();
state.data = JSON.parse(byId("page").textContent);
showComparison(state.data.comparisons[0]);
