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

begin();
state.data = JSON.parse(byId("page").textContent);
showComparison(state.data.comparisons[0]);
