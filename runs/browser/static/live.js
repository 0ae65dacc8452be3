"use strict";
// Where data come from: the server of this page, which is asked again and again. What has not changed is not loaded again.

const REST = 1000, PATIENCE = 4000; // milliseconds between two questions, and after one without an answer
const SHARE = 4; // the page rests at least so many times as long as it took to show what is new

const held = {}; // versions of what is shown
let unreadable = [];
let comparing = false, rested = 0; // whether solvers are being compared now, and when they may be again
let latest = {};

async function ask(path) {
  const answer = await fetch(path);
  if (!answer.ok) throw new Error(`the server answers ${answer.status}`);
  return answer.json();
}

const readDetails = (run) => ask(`details/${run.block}.json`);

/** Ask how it stands, show what is new; returns the milliseconds until the next time. */
async function follow() {
  let status;
  const fresh = {};
  try {
    status = await ask("status.json");
    for (const name of ["data", "going"]) {
      if (status.versions[name] && held[name] !== status.versions[name]) fresh[name] = await ask(`${name}.json`);
    }
  } catch {
    const since = byId("trouble").dataset.since ?? new Date().toLocaleTimeString();
    byId("trouble").dataset.since = since;
    tell([`The server has not answered since ${since}. The page shows what it knew then, and goes on by itself once there is an answer.`]);
    return PATIENCE;
  }
  delete byId("trouble").dataset.since;
  const began = performance.now();
  for (const name of Object.keys(fresh)) held[name] = status.versions[name];
  latest = status;
  show(status, fresh);
  compare(status);
  return Math.max(REST, SHARE * (performance.now() - began));
}

/** Ask for the comparison of solvers, which may take minutes: the page goes on meanwhile. While a study runs, it takes a tenth of the time. */
function compare({ versions: { measures: version }, alive }) {
  const began = performance.now();
  if (comparing || !version || held.measures === version || (alive && began < rested)) return;
  comparing = true;
  ask("measures.json").then((measures) => {
    held.measures = version;
    show(latest, { measures });
  }).catch((error) => console.warn(error)).finally(() => {
    comparing = false;
    rested = performance.now() + 9 * (performance.now() - began);
  });
}

function show(status, { data, going, measures }) {
  if (data) unreadable = data.unreadable;
  if (measures) state.measures = measures;
  if (going) state.going = going;
  const found = data ?? ((measures || (going && !state.comparison)) && state.data);
  if (found) {
    for (const one of found.comparisons) Object.assign(one, state.measures?.comparisons[one.id]);
    renew(found);
    showParts();
  } else if (going && state.comparison) drawFront();
  if (status.total !== undefined) showStatus(status);
  if (data?.failures) showFailures(data.failures);
  if (state.measures) showMeasured(status);
  tell([...(status.trouble ? [`Not readable now: ${status.trouble}.`] : []), ...unreadable]);
  if (state.data && canDraw()) document.documentElement.dataset.ready = "yes";
}

/** Without any front there is no place for figures. */
function showParts() {
  const some = state.comparison !== null;
  byId("front").hidden = byId("points").hidden = !some;
  if (!some) byId("flights").hidden = true;
}

/** Of how many runs the comparison of solvers is. */
function showMeasured({ finished, alive }) {
  const { trouble, finished: measured } = state.measures;
  const later = alive ? " It is made again from time to time." : "";
  const words = trouble ? `Solvers cannot be compared: ${trouble}.` : `Of ${measured} of ${counted(finished ?? 0, "finished run")}.${measured < finished ? later : ""}`;
  if (trouble) byId("study").hidden = false;
  fill(byId("study-note"), words);
}

/** Say what is wrong; the same words are not said twice. */
function tell(lines) {
  const place = byId("trouble");
  const words = lines.join(" ");
  if (place.textContent !== words) fill(place, words);
  place.hidden = !words;
}

function again(wait) {
  setTimeout(() => follow().then(again, (error) => {
    again(PATIENCE);
    throw error;
  }), wait);
}

begin();
fill(byId("headline"), "Reading the files \u2026");
again(0);
document.addEventListener("DOMContentLoaded", drawFigures); // the drawing package is read by then
