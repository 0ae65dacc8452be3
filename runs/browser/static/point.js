"use strict";
// What is known of the selected point.

function showPoint() {
  const place = byId("point");
  const point = selectedPoint();
  if (!point) {
    const hint = "None. Click a point in the figure or a row of the table; in the table, arrow keys move and Enter selects.";
    fill(place, element("p", { class: "note" }, state.points.length ? hint : "There is no point."));
    return;
  }
  const kept = state.kept.includes(point.key);
  const buttons = element(
    "div",
    { class: "bar" },
    element("button", { type: "button", onclick: () => step(-1) }, "Previous"),
    element("button", { type: "button", onclick: () => step(1) }, "Next"),
    element("button", { type: "button", id: "keep", "aria-pressed": String(kept), onclick: () => keep(point.key, !kept) }, kept ? "Kept: let go" : "Keep its trajectory"),
  );
  const rest = element("div", {}, element("p", { class: "note" }, "loading\u2026"));
  fill(place, element("p", {}, element("strong", {}, pointName(point)), " ", badge(point)), objectivesTable(point), isDetailed(point) ? factsTable(point) : null, buttons, rest);
  details(point.run).then(
    (all) => {
      if (state.selected === point.key) fill(rest, restOf(point, all[point.index]));
    },
    (error) => fill(rest, element("p", { class: "warning" }, `The details cannot be read: ${error.message}.`)),
  );
}

/** Select the next or previous point, in the order of the table. */
function step(by) {
  const order = tableOrder();
  const place = order.findIndex((point) => point.key === state.selected);
  const next = order[(place + by + order.length) % order.length];
  if (next) select(next.key);
  byId("point").querySelectorAll("button")[by < 0 ? 0 : 1].focus();
}

function badge(point) {
  const text = statusOf(point);
  return counts(point) ? text : element("span", { class: "badge" }, text);
}

const isDetailed = (point) => detailed() || !counts(point);

function objectivesTable(point) {
  const { goals } = state.comparison;
  const simulated = isDetailed(point) && point.simulated.some((value) => value !== null);
  const head = element("tr", {}, ...["objective", "value", ...(simulated ? ["simulated"] : [])].map((words, k) => element("th", { scope: "col", class: k ? "" : "words" }, words)));
  const rows = goals.map((goal, i) => {
    const cells = [point.values[i], ...(simulated ? [point.simulated[i]] : [])];
    return element("tr", {}, element("th", { scope: "row" }, withUnit(goal.name, goal.unit)), ...cells.map((value) => element("td", { class: "number" }, isDetailed(point) ? number(value, 7) : fixed(value, state.decimals[i]))));
  });
  return element("table", { class: "facts" }, element("thead", {}, head), element("tbody", {}, rows));
}

function factsTable(point) {
  const facts = {
    "violation, largest scaled residual": small(point.violation),
    "violation when simulated": small(point.simulatedViolation),
    "defect, states simulated against stated": point.run.about.dynamic ? small(point.defect) : "-",
    "optimality, residual of its conditions": small(point.optimality),
  };
  const known = Object.entries(facts).filter(([, text]) => text !== "-");
  return element("table", { class: "facts" }, element("tbody", {}, known.map(([words, text]) => row([words, text]))));
}

const row = ([words, ...texts]) => element("tr", {}, element("th", { scope: "row" }, words), ...texts.map((text) => element("td", { class: "number" }, text)));

/** Note, weights, parameters and residuals by constraint. */
function restOf(point, detail) {
  const found = [];
  if (detail.note) found.push(element("p", { class: counts(point) ? "note" : "warning" }, `Note: ${detail.note}.`));
  const { goals } = state.comparison;
  if (detail.weights && goals.length > 1) {
    found.push(folded("Weights for which it is optimal", goals.map((goal, i) => [goal.name, number(detail.weights[i], 4)])));
  }
  const what = point.run.about.dynamic ? "Parameters" : "Variables";
  const parameters = detail.parameters.map((one) => {
    const known = one.lower !== undefined;
    return [withUnit(one.name, one.unit), number(one.value, 7), known ? limitsText(one.lower, one.upper) : ""];
  });
  found.push(folded(what, parameters, !point.run.about.dynamic));
  found.push(folded("Residuals by constraint, scaled", Object.entries(detail.violations).map(([name, value]) => [name, small(value)])));
  found.push(folded("Leaves its bounds between nodes, scaled", Object.entries(detail.excursions).map(([name, value]) => [name, small(value)])));
  return found;
}

function folded(title, rows, open = false) {
  if (!rows.length) return null;
  return element("details", { open }, element("summary", {}, title), element("table", { class: "facts" }, element("tbody", {}, rows.map(row))));
}
