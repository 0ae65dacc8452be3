"use strict";
// How a study proceeds, while it runs: its runs by state, those that are being made, and failures.

let toldState = "";

/** Seconds as minutes or hours: 0:41, 1:02:00. */
function clock(seconds) {
  const whole = Math.max(0, Math.round(seconds));
  const two = (value) => String(value).padStart(2, "0");
  const [hours, minutes] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60];
  return hours ? `${hours}:${two(minutes)}:${two(whole % 60)}` : `${minutes}:${two(whole % 60)}`;
}

/** The state of all runs in one line. */
function progressLine({ total, finished, failed, running, waiting, alive, left }) {
  const parts = [`${finished} of ${counted(total, "run")} finished`];
  if (failed) parts.push(`${failed} failed`);
  if (running) parts.push(`${running} running`);
  if (waiting) parts.push(`${waiting} ${alive ? "waiting" : "not made"}`);
  return parts.join(", ");
}

/** What is happening in the study's folder. */
function activity({ alive, left, elapsed, waiting, running }) {
  if (alive) return left !== null && waiting + running > 0 ? `Running for ${clock(elapsed)}; about ${clock(left)} to go.` : `Running for ${clock(elapsed)}.`;
  return waiting ? "No process is making runs now: the same command goes on with those that are not made." : "The study has ended.";
}

/** Show the state of the runs; parts that are the same are left alone, so that they can be read and marked. */
function showStatus(status) {
  document.title = `${status.finished}/${status.total} ${state.data?.title ?? byId("title").textContent}`;
  byId("progress").hidden = false;
  const line = progressLine(status);
  fill(byId("headline"), line);
  if (!byId("progress-line")) buildProgress();
  const bar = byId("progress-bar");
  Object.assign(bar, { max: status.total, value: status.finished + status.failed });
  bar.setAttribute("aria-label", line);
  fill(byId("progress-line"), ` ${activity(status)}`);
  renewed("progress-going", status.going, goingTable);
  renewed("progress-cells", [status.cells, status.alive], () => cellsTable(status));
  const told = `${line}${status.alive ? "" : `. ${activity(status)}`}`;
  // Runs that begin are not worth a word to those who listen.
  const key = JSON.stringify([status.finished, status.failed, status.alive]);
  if (key !== toldState) announce(told);
  toldState = key;
}

function buildProgress() {
  const parts = ["going", "cells", "failures"].map((name) => element("div", { id: `progress-${name}` }));
  fill(byId("progress-body"), element("p", {}, element("progress", { id: "progress-bar" }), element("span", { id: "progress-line" })), parts);
}

const contents = new Map();

/** Fill a part of the page if its data are others than before. */
function renewed(id, data, build) {
  const now = JSON.stringify(data);
  if (contents.get(id) === now) return;
  contents.set(id, now);
  rebuilt(byId(id), () => fill(byId(id), build(data)));
}

/** The runs that are being made. */
function goingTable(going) {
  if (!going.length) return [];
  const rows = going.map(({ name, evaluations, budget, elapsed }) => {
    const text = budget === null ? counted(evaluations, "evaluation") : `${grouped(evaluations)} of ${counted(budget, "evaluation")}`;
    const bar = budget === null ? null : element("progress", { max: budget, value: evaluations, "aria-label": `${name}: ${text}` });
    return element("tr", {}, element("th", { scope: "row", class: "words" }, name), element("td", {}, bar), element("td", {}, text), element("td", {}, clock(elapsed)));
  });
  const head = ["running", "", "evaluations", "time"].map((words, k) => element("th", { scope: "col", class: k ? null : "words" }, words));
  return [element("div", { class: "scroll" }, element("table", { class: "going" }, element("thead", {}, element("tr", {}, head)), element("tbody", {}, rows)))];
}

function cellsTable({ cells, alive }) {
  const heads = ["problem", "transcription", "solver", "finished", "running", alive ? "waiting" : "not made", "failed", "median time [s]"];
  const rows = cells.map((cell) => [...cell.labels, ...[cell.finished, cell.running, cell.waiting, cell.failed].map(String), number(cell.time, 3)]);
  return [tableElement({ caption: "", heads, rows, words: heads.map((_, k) => k < 3), notes: [] })];
}

/** The failures; those that were unfolded stay so. */
function showFailures(failures) {
  renewed("progress-failures", failures, () => {
    const open = new Set([...document.querySelectorAll("#progress-failures details[open]")].map((one) => one.dataset.name));
    const made = failuresList(failures);
    for (const one of made) if (open.has(one.dataset.name)) one.open = true;
    return made;
  });
}
