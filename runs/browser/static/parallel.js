"use strict";
// The front in parallel coordinates: a line for each point; a range marked on an axis is a preference.

function drawParallel(place) {
  const { goals, solvers } = state.comparison;
  const chosen = selectedPoint();
  // The last line is drawn above the others.
  const points = shownPoints().filter((point) => point !== chosen);
  if (chosen && isShown(chosen)) points.push(chosen);
  const dimensions = goals.map((goal, i) => {
    const values = points.map((point) => point.values[i]);
    const [low, high] = extent(values);
    const margin = high > low ? 0.02 * (high - low) : 0.5 * Math.abs(high) || 1;
    const ends = [low - margin, high + margin];
    return {
      name: String(i),
      label: plotText(withUnit(goal.name, goal.unit)),
      values,
      range: goal.sense === "minimize" ? ends.reverse() : ends,
      constraintrange: state.ranges[i] ?? undefined,
      multiselect: false,
    };
  });
  const many = solvers.length > 1 && view.color === "solver";
  const colored = view.color === "solver" ? 0 : Number(view.color);
  const [low, high] = extent(points.map((point) => point.values[colored]));
  const share = (point) => (high > low ? (point.values[colored] - low) / (high - low) : 0.5);
  const color = points.map((point) => {
    if (point === chosen) return 1;
    return 0.8 * (many ? (solverIndex(point.solver) + 0.5) / solvers.length : share(point));
  });
  const line = { color, cmin: 0, cmax: 1, colorscale: many ? solverScale(solvers.length) : valueScale() };
  const trace = { type: "parcoords", dimensions, line, labelside: "top", unselected: { line: { color: "#bbb", opacity: 0.25 } } };
  draw(place, [trace], layout({ height: 440, margin: { l: 80, r: 80, t: 70, b: 30 } }));
}

/** From 0 to 0.8 a band of its own for each solver; above, the selected point in black. */
function solverScale(count) {
  const scale = [];
  for (let k = 0; k < count; k += 1) scale.push([(0.8 * k) / count, colorOf(k)], [(0.8 * (k + 1)) / count, colorOf(k)]);
  return [...scale, [0.9, "#000"], [1, "#000"]];
}

/** From 0 to 0.8 the colours of values, without the palest; above, the selected point in red. */
function valueScale() {
  const colors = ["#440154", "#3b528b", "#21918c", "#5ec962", "#c2df23"];
  return [...colors.map((color, k) => [(0.8 * k) / (colors.length - 1), color]), [0.9, "#D40000"], [1, "#D40000"]];
}

/** A range that is marked on an axis becomes a preference. */
function listenToParallel(place) {
  place.on("plotly_restyle", () => {
    const before = JSON.stringify(state.ranges);
    for (const dimension of place.data[0].dimensions) {
      const marked = dimension.constraintrange;
      const range = Array.isArray(marked) && Array.isArray(marked[0]) ? marked[0] : marked;
      state.ranges[Number(dimension.name)] = range ? [...range].sort((a, b) => a - b) : null;
    }
    if (JSON.stringify(state.ranges) !== before) emit("filter");
  });
}
