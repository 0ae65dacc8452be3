"use strict";
// Colours, markers and the common look of all figures.

// Of Okabe and Ito, which readers with any colour vision can tell apart; a marker and a dash for each of them as well.
const COLORS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#882255"];
const MARKERS = ["circle", "triangle-up", "square", "diamond", "triangle-down", "pentagon", "x", "star"];
const MARKERS_3D = ["circle", "square", "diamond", "cross", "x"]; // all that there are in space
const SIGNS = ["\u25CF", "\u25B2", "\u25A0", "\u25C6", "\u25BC", "\u2B1F", "\u2716", "\u2605"]; // the same, as letters
const DASHES = ["solid", "dash", "dashdot", "dot"];
const INK = "#1a1a1a", GREY = "#8a8a8a", FAINT = "#cfcfcf";
const SCALE = "Viridis";
const FONT = { family: 'system-ui, "Segoe UI", Roboto, "Liberation Sans", sans-serif', size: 12, color: INK };

const colorOf = (k) => COLORS[k % COLORS.length];
const solverIndex = (solver) => state.comparison.solvers.indexOf(solver);

const axis = (title, more = {}) => ({
  title: { text: title, standoff: 8 },
  automargin: true,
  zeroline: false,
  gridcolor: "#e4e4e4",
  linecolor: INK,
  showline: true,
  ticks: "outside",
  ticklen: 4,
  exponentformat: "power",
  minexponent: 7,
  ...more,
});

const layout = (more = {}) => ({
  font: FONT,
  separators: ".", // of decimals; none of thousands
  paper_bgcolor: "#fff",
  plot_bgcolor: "#fff",
  margin: { l: 60, r: 34, t: 30, b: 50 },
  modebar: { orientation: "v" }, // beside the figure, not above its legend
  hovermode: "closest",
  hoverlabel: { bgcolor: "#fff", bordercolor: INK, font: FONT, align: "left" },
  legend: { orientation: "h", x: 0, xanchor: "left", y: 1.02, yanchor: "bottom", itemclick: false, itemdoubleclick: false },
  ...more,
});

const CONFIG = {
  displaylogo: false,
  showSendToCloud: false, // nothing leaves this page
  plotlyServerURL: "",
  responsive: true,
  modeBarButtonsToRemove: ["lasso2d", "autoScale2d", "toggleSpikelines", "hoverCompareCartesian", "hoverClosestCartesian"],
  toImageButtonOptions: { format: "png", scale: 3 },
};

const canvas = document.createElement("canvas");
/** Whether there is a graphics interface for figures in space, parallel coordinates and many points. */
const HAS_GL = Boolean(canvas.getContext("webgl"));

/** The text that a point shows under the pointer. */
function hoverText(point) {
  const lines = state.comparison.goals.map((goal, i) => {
    const unit = goal.unit ? ` ${plotText(goal.unit)}` : "";
    return `${plotText(goal.name)} ${number(point.values[i])}${unit}`;
  });
  return [`<b>${plotText(pointName(point))}</b>, ${statusOf(point)}`, ...lines].join("<br>");
}

const pending = new WeakMap();

/** Draw a figure. */
function draw(place, traces, figure, config = CONFIG) {
  pending.set(place, Plotly.react(place, traces, figure, config));
}

/** Give up a figure, once its last drawing has ended: the package still reads what it draws. */
function retire(place) {
  const free = () => Plotly.purge(place);
  Promise.resolve(pending.get(place)).then(free, free);
}
