"use strict";
// The table of points: sorted by any column; rows are selected by pointer or keys. It has all that the figure of the front shows.

const rowsOfPage = () => (state.data.kind === "front" ? 100 : 25);
const table = { by: 0, descending: false, page: 0 };

/** The columns: title, unit, value of a point, and how a list of values is written. */
function tableColumns() {
  const { goals } = state.comparison;
  const several = state.data.kind !== "front";
  const texts = (values) => values.map(String);
  const smalls = (values) => values.map(small);
  const dynamic = state.comparison.runs.some((run) => run.about.dynamic);
  const how = dynamic ? "simulated" : "again";
  const all = [
    ...(several ? [{ title: "solver", words: true, value: (p) => p.solver, text: texts }, { title: "run", value: (p) => p.run.number, text: texts }] : []),
    { title: several ? "point" : "#", value: (p) => p.index, text: texts },
    ...goals.map((goal, i) => ({ title: goal.name, unit: `${goal.sense.slice(0, 3)} [${goal.unit || "-"}]`, value: (p) => p.values[i], text: columnWithin(state.decimals[i]) })),
    ...(state.comparison.runs.find((run) => run.points.parameters.length)?.points.parameters ?? []).map((one, k) => {
      const words = one.values.some((value) => typeof value === "string");
      return { title: one.name, unit: `[${one.unit || "-"}]`, words, value: (p) => p.run.points.parameters[k]?.values[p.index] ?? null, text: words || one.values.every(Number.isInteger) ? texts : columnWithin(decimalsWithin(one.values, one.resolution)) };
    }),
    { title: "violation", value: (p) => p.violation, text: smalls, hidden: !detailed() },
    { title: "defect", unit: how, value: (p) => p.defect, text: smalls, optional: true, hidden: !dynamic || !detailed() },
    { title: "violation", unit: how, value: (p) => p.simulatedViolation, text: smalls, optional: true, hidden: !detailed() },
    { title: "optimality", value: (p) => p.optimality, text: smalls, optional: true, hidden: !detailed() },
    { title: "status", words: true, value: statusOf, text: texts },
  ];
  return all.filter((one) => !one.hidden && (!one.optional || state.points.some((point) => one.value(point) !== null)));
}

const columnWithin = (decimals) => (values) => (decimals === null ? column(values) : values.map((value) => fixed(value, decimals)));

/** Whether violation, defect, optimality and the like are shown, of the table and of the selected point. */
function buildDetails() {
  const change = (event) => {
    const by = tableColumns()[table.by];
    state.details = event.target.checked;
    table.by = Math.max(0, tableColumns().findIndex((one) => one.title === by.title && one.unit === by.unit));
    showTable();
    showPoint();
  };
  fill(byId("table-details"), element("label", {}, element("input", { type: "checkbox", checked: detailed(), onchange: change }), " violation, defect, optimality"));
}

/** The wanted points in the order of the table. */
function tableOrder() {
  const chosen = tableColumns()[table.by];
  const value = chosen.value;
  const compare = (a, b) => {
    const [first, second] = [value(a), value(b)];
    if (first === null || second === null) return (first === null) - (second === null); // unknown values come last
    const order = first < second ? -1 : first > second ? 1 : 0;
    return table.descending ? -order : order;
  };
  return wantedPoints().sort(compare);
}

function showTable() {
  const columns = tableColumns();
  const order = tableOrder();
  const pages = Math.max(1, Math.ceil(order.length / rowsOfPage()));
  table.page = Math.min(table.page, pages - 1);
  const rows = order.slice(table.page * rowsOfPage(), (table.page + 1) * rowsOfPage());
  const texts = columns.map((one) => one.text(rows.map(one.value)));
  const head = element("tr", {}, columns.map((one, k) => headCell(one, k)));
  const chosen = rows.findIndex((point) => point.key === state.selected);
  const body = rows.map((point, r) =>
    element(
      "tr",
      { "data-key": point.key, tabindex: r === Math.max(chosen, 0) ? "0" : "-1", "aria-selected": String(point.key === state.selected), class: counts(point) ? null : "unverified" },
      columns.map((one, k) => element("td", { class: one.words ? "words" : null }, one.title === "status" && !counts(point) ? badge(point) : texts[k][r])),
    ),
  );
  const label = "Points; arrow keys move between rows, Enter selects";
  const made = element("table", { role: "grid", "aria-label": label, "aria-rowcount": order.length + 1 }, element("thead", {}, head), element("tbody", { onclick: clicked, onkeydown: pressed }, body));
  fill(byId("table"), made);
  showPages(pages, order.length);
  const unverified = shownPoints().filter((point) => !counts(point)).length;
  const marked = unverified ? ` ${unverified} not verified, in italics and hollow in figures.` : "";
  fill(byId("table-note"), state.points.length === 0 ? "There is no point yet." : `${counted(order.length, "point")} of ${state.points.length}. A click on a title sorts.${marked}`);
}

function headCell(one, k) {
  const sorted = k === table.by ? (table.descending ? "descending" : "ascending") : null;
  const sort = () => {
    table.descending = k === table.by && !table.descending;
    Object.assign(table, { by: k, page: 0 });
    showTable();
    byId("table").querySelectorAll("th button")[k].focus();
    announce(`sorted by ${one.title}, ${table.descending ? "greatest" : "least"} first`);
  };
  const button = element("button", { type: "button", onclick: sort }, one.title);
  return element("th", { scope: "col", "aria-sort": sorted, class: one.words ? "words" : null }, button, one.unit ? element("span", { class: "unit" }, one.unit) : null);
}

function showPages(pages, count) {
  const turn = (by) => () => {
    table.page += by;
    showTable();
    byId("table-pages").querySelectorAll("button")[by < 0 ? 0 : 1].focus();
  };
  if (pages === 1) return fill(byId("table-pages"));
  const first = table.page * rowsOfPage() + 1;
  fill(
    byId("table-pages"),
    element("button", { type: "button", onclick: turn(-1), disabled: table.page === 0 }, "Previous page"),
    element("button", { type: "button", onclick: turn(1), disabled: table.page === pages - 1 }, "Next page"),
    element("span", { class: "note" }, `rows ${first} to ${Math.min(first + rowsOfPage() - 1, count)} of ${count}`),
  );
}

function clicked(event) {
  const row = event.target.closest("tr");
  if (row) select(row.dataset.key);
}

function pressed(event) {
  const row = event.target.closest("tr");
  const moves = { ArrowDown: row.nextElementSibling, ArrowUp: row.previousElementSibling, Home: row.parentNode.firstElementChild, End: row.parentNode.lastElementChild };
  if (event.key === "Enter" || event.key === " ") select(row.dataset.key);
  else if (moves[event.key]) focusRow(moves[event.key]);
  else if (!(event.key in moves)) return;
  event.preventDefault();
}

/** One row can be reached by the tabulator key; arrow keys move to the others. */
function focusRow(row) {
  if (!row) return;
  row.parentNode.querySelectorAll('tr[tabindex="0"]').forEach((other) => other.setAttribute("tabindex", "-1"));
  row.setAttribute("tabindex", "0");
  row.focus({ preventScroll: isSeen(row) });
}

const isSeen = (row) => {
  const { top, bottom } = row.getBoundingClientRect();
  return top >= 0 && bottom <= window.innerHeight;
};

/** Mark the selected row; turn to its page if it is on another. */
function markRow() {
  const order = tableOrder();
  const place = order.findIndex((point) => point.key === state.selected);
  if (place >= 0 && Math.floor(place / rowsOfPage()) !== table.page) {
    table.page = Math.floor(place / rowsOfPage());
    showTable();
  }
  for (const row of byId("table").querySelectorAll("tbody tr")) {
    const chosen = row.dataset.key === state.selected;
    row.setAttribute("aria-selected", String(chosen));
    if (chosen) row.setAttribute("tabindex", "0");
    else if (place >= 0) row.setAttribute("tabindex", "-1");
  }
}
