"use strict";
// Where data come from: compressed blocks in this page, each read when it is first needed.

const loaded = new Map();

/** The details of all points of a run, once they are asked for: a promise of a list. */
function details(run) {
  if (!loaded.has(run.block)) {
    const found = read(run.block);
    loaded.set(run.block, found);
    found.catch(() => loaded.delete(run.block));
  }
  return loaded.get(run.block);
}

async function read(block) {
  const place = byId(`block-${block}`);
  if (!place) throw new Error("it is not in this file");
  if (!("DecompressionStream" in window)) throw new Error("this browser is too old: it cannot decompress data");
  const bytes = Uint8Array.from(atob(place.textContent), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).json();
}
