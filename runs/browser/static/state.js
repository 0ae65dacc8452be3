"use strict";
// What is shown: one comparison, its points, what is selected, and which ranges of the objectives are wanted.

const MOST_KEPT = 6;

const state = {
  data: null,
  comparison: null,
  points: [], // of the comparison, all runs
  byKey: new Map(),
  selected: null, // key of a point
  kept: [], // keys of points whose trajectories stay
  decimals: [], // of each objective, as far as its points are verified; null: not known
  details: null, // whether violation, defect and the like are shown; null: only where a point is not as it should be
  ranges: [], // of each objective [least, greatest], or null
  hidden: new Set(), // solvers
  run: "", // number of the run that is shown; "": all
  going: {}, // of each comparison the points so far of runs that have not ended
};

const listeners = { comparison: [], filter: [], selection: [], renewal: [] };
const on = (event, listener) => listeners[event].push(listener);
const emit = (event) => listeners[event].forEach((listener) => listener());

function take(comparison) {
  state.comparison = comparison;
  state.points = comparison.runs.flatMap((run) => pointsOf(run));
  state.byKey = new Map(state.points.map((point) => [point.key, point]));
  state.decimals = comparison.goals.map((_, i) => {
    const known = comparison.runs.map((run) => run.points.tolerances[i]).filter((one) => one !== null);
    return decimalsWithin(state.points.map((point) => point.values[i]), Math.min(...known));
  });
}

/** Show a comparison from its beginning: a point in the middle selected, nothing hidden. */
function showComparison(comparison) {
  take(comparison);
  Object.assign(state, { selected: opening()?.key ?? null, kept: [], ranges: comparison.goals.map(() => null), hidden: new Set(), run: "" });
  emit("comparison");
}

/** Show newer data. Of the comparison that is shown all that was chosen stays: selection, kept points, ranges, solvers and run. */
function renew(data) {
  state.data = data;
  const same = data.comparisons.find((one) => one.id === state.comparison?.id);
  if (!same || same.goals.length !== state.comparison.goals.length) {
    if (data.comparisons.length) showComparison(data.comparisons[0]);
    return;
  }
  const chosen = selectedPoint();
  take(same);
  state.kept = state.kept.filter((key) => state.byKey.has(key));
  if (!state.byKey.has(state.selected)) state.selected = null;
  emit("renewal");
  // Another run in the same place has other trajectories.
  if (selectedPoint()?.run.version !== chosen?.run.version) emit("selection");
}

const loaded = new Map();

/** The details of all points of a run, once they are asked for: a promise of a list. */
function details(run) {
  const key = `${run.block} ${run.version ?? ""}`;
  if (!loaded.has(key)) {
    const found = readDetails(run);
    loaded.set(key, found);
    found.catch(() => loaded.delete(key));
  }
  return loaded.get(key);
}

/** The points of a run, each with its values in the order of the objectives. */
function pointsOf(run) {
  const columns = run.points;
  return Array.from({ length: columns.count }, (_, index) => ({
    key: `${run.block}:${index}`,
    run,
    index,
    solver: run.solver,
    values: columns.objectives.map((values) => values[index]),
    simulated: columns.simulated.map((values) => values[index]),
    verified: columns.verified[index],
    violation: columns.violation[index],
    defect: columns.defect[index],
    simulatedViolation: columns.simulated_violation[index],
    optimality: columns.optimality[index],
    status: columns.status[index],
  }));
}

/** Whether a point is good: not one that a simulation does not confirm, and feasible. */
const counts = (point) => point.verified !== false && point.status === "converged";

const detailed = () => state.details ?? !state.points.every(counts);

const statusOf = (point) => {
  if (point.status !== "converged" || point.verified === null) return point.status;
  return point.verified ? "verified" : "not verified";
};

/**
 * The point that a page opens with. Of two objectives it is the knee: the farthest, in ranges, from the line between the ends; else it is the
 * middle one by the first objective.
 */
function opening() {
  const good = state.points.filter(counts);
  const points = [...(good.length ? good : state.points)].sort((a, b) => a.values[0] - b.values[0]);
  if (state.comparison.goals.length !== 2 || points.length < 3) return points[points.length >> 1];
  const ends = [points[0], points.at(-1)];
  const [width, height] = [0, 1].map((i) => ends[1].values[i] - ends[0].values[i] || 1);
  const off = ({ values }) => Math.abs((values[0] - ends[0].values[0]) / width - (values[1] - ends[0].values[1]) / height);
  return points.reduce((best, point) => (off(point) > off(best) ? point : best));
}

/** Whether a point's solver and run are shown. */
const isShown = (point) => !state.hidden.has(point.solver) && (state.run === "" || String(point.run.number) === state.run);

/** Whether a point is within all ranges that are wanted. */
const isWanted = (point) => state.ranges.every((range, i) => !range || (point.values[i] >= range[0] && point.values[i] <= range[1]));

const shownPoints = () => state.points.filter(isShown);
const wantedPoints = () => state.points.filter((point) => isShown(point) && isWanted(point));

function select(key) {
  if (!state.byKey.has(key) || key === state.selected) return;
  state.selected = key;
  emit("selection");
}

const selectedPoint = () => state.byKey.get(state.selected) ?? null;

/** Keep a point's trajectory beside others, or no longer. */
function keep(key, wanted) {
  state.kept = state.kept.filter((one) => one !== key);
  if (wanted) state.kept = [...state.kept, key].slice(-MOST_KEPT);
  emit("selection");
}

/** Want values of objective i from `range[0]` to `range[1]`; null: any. */
function setRange(i, range) {
  const wanted = range && [Math.min(...range), Math.max(...range)];
  if (JSON.stringify(wanted) === JSON.stringify(state.ranges[i])) return;
  state.ranges[i] = wanted;
  emit("filter");
}

function clearRanges() {
  state.ranges = state.ranges.map(() => null);
  emit("filter");
}

/** Say something to those who do not see the page. */
function announce(text) {
  byId("announcements").textContent = text;
}

/** The objectives of a point in words. */
const inWords = (point) =>
  state.comparison.goals.map((goal, i) => `${goal.name} ${fixed(point.values[i], state.decimals[i])}${goal.unit ? ` ${goal.unit}` : ""}`).join(", ");

/** The name of a point: of one run its number, of several solver and run before it. */
function pointName(point) {
  if (state.data.kind === "front") return `Point ${point.index}`;
  if (state.data.kind === "fronts") return `${point.solver}, point ${point.index}`;
  return `${point.solver}, run ${point.run.number}, point ${point.index}`;
}
