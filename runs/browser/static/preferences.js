"use strict";
// Ranges of the objectives that are wanted: numbers and sliders, for hands and keyboards alike, linked with the figures.

let rangeFields = [];

function buildPreferences() {
  const place = byId("preferences");
  rangeFields = state.comparison.goals.map((goal, i) => rangeField(goal, i));
  const all = element("button", { type: "button", onclick: clearRanges }, "Any values");
  fill(place, element("p", { id: "wanted", class: "note" }), rangeFields.map((field) => field.box), all);
  showPreferences();
}

/** The fields of one objective: least and greatest value, each as a number and as a slider. */
function rangeField(goal, i) {
  const field = { low: 0, high: 1, ends: {} };
  const name = withUnit(goal.name, goal.unit);
  const change = (which, value) => {
    const { low, high, ends } = field;
    const now = state.ranges[i] ?? [ends.min, ends.max];
    const next = which === 0 ? [value, Math.max(now[1], value)] : [Math.min(now[0], value), value];
    setRange(i, next[0] <= low && next[1] >= high ? null : next);
  };
  const fields = ["at least", "at most"].map((words, which) => {
    const changed = (event) => {
      const value = event.target.valueAsNumber;
      if (Number.isFinite(value)) change(which, value);
      else change(which, which === 0 ? field.ends.min : field.ends.max); // an empty field: any value
    };
    const typed = element("input", { type: "number", step: "any", onchange: changed, "aria-label": `${name}, ${words}` });
    const slider = element("input", { type: "range", oninput: changed, "aria-label": `${name}, ${words}, slider` });
    return { label: element("label", {}, words, typed), typed, slider };
  });
  const best = goal.sense === "minimize" ? "small is better" : "large is better";
  const legend = element("legend", {}, `${name} `, element("span", { class: "note" }, best));
  const box = element("fieldset", { class: "range" }, legend, ...fields.map((f) => f.label), ...fields.map((f) => f.slider));
  return measured(Object.assign(field, { box, fields }), i);
}

/** The field of objective i with the range of its points. */
function measured(field, i) {
  const [low, high] = extent(state.points.map((point) => point.values[i]));
  const step = (high - low) / 200 || 1;
  // Sliders move in steps; their ends must take in the outermost points.
  const ends = { min: low - step, max: high + step, step };
  for (const { slider } of field.fields) for (const [name, value] of Object.entries(ends)) slider.setAttribute(name, value);
  return Object.assign(field, { low, high, ends });
}

/** Other points are there: the fields stay, with what was typed into them. */
function renewPreferences() {
  rangeFields.forEach(measured);
  showPreferences();
}

/** Show the ranges that are wanted, wherever they were chosen. */
function showPreferences() {
  rangeFields.forEach(({ fields, low, high, ends }, i) => {
    const range = state.ranges[i];
    const digits = high > low ? Math.max(4, Math.ceil(Math.log10(Math.max(Math.abs(low), Math.abs(high)) / (high - low))) + 4) : 6;
    fields.forEach(({ typed, slider }, which) => {
      slider.value = range ? range[which] : which === 0 ? ends.min : ends.max;
      // What is typed stays as it is typed.
      if (document.activeElement !== typed || !range) typed.value = range ? Number(range[which].toPrecision(Math.min(digits, 15))) : "";
      const end = which === 0 ? low : high;
      typed.placeholder = state.decimals[i] === null ? Number(end.toPrecision(5)) : end.toFixed(state.decimals[i]);
    });
  });
  const shown = shownPoints().length, wanted = wantedPoints().length;
  byId("wanted").textContent = `${wanted} of ${counted(shown, "point")} within these ranges.`;
}

function announceWanted() {
  if (state.ranges.some(Boolean)) announce(byId("wanted").textContent);
}
