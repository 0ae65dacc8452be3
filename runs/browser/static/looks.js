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
  margin: { l: 60, r: 34, t: 30, b: 52 }, // as much as labels need: where margins must grow, a figure is drawn twice
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

let graphics = null;
/** Whether there is a graphics interface for figures in space, parallel coordinates and many points. Asked only if need be: it takes long. */
const hasGl = () => (graphics ??= Boolean(document.createElement("canvas").getContext("webgl")));

/** Whether the drawing package has been read: it is large, and what needs no figure is shown before. */
const canDraw = () => "Plotly" in window;

/** What a point shows under the pointer: the data of each point, and the text that they are put into once it is shown. */
const hoverData = (point) => [point.key, plotText(pointName(point)), statusOf(point), ...point.values];
function hoverTemplate() {
  const lines = state.comparison.goals.map((goal, i) => {
    const [name, unit] = [goal.name, goal.unit].map((text) => plotText(text).replace(/[{}%]/g, ""));
    const digits = state.decimals[i] === null ? ".6~g" : `.${state.decimals[i]}f`;
    return `${name} %{customdata[${i + 3}]:${digits}}${unit ? ` ${unit}` : ""}`;
  });
  return ["<b>%{customdata[1]}</b>, %{customdata[2]}", ...lines].join("<br>") + "<extra></extra>";
}

const pending = new WeakMap();
const unseen = new Map(); // places of figures that are not drawn yet, and how they are to be drawn
const watcher = new IntersectionObserver(
  (entries) => entries.filter((one) => one.isIntersecting).forEach((one) => drawUnseen(one.target)),
  { rootMargin: "300px" },
);
window.addEventListener("beforeprint", () => [...unseen.keys()].forEach(drawUnseen));

/** Draw a figure once it comes into view, or the page is printed. */
function drawWhenSeen(place, ...figure) {
  if (pending.has(place)) return draw(place, ...figure);
  unseen.set(place, figure);
  watcher.observe(place);
}

function drawUnseen(place) {
  const figure = unseen.get(place);
  forget(place);
  if (figure) draw(place, ...figure);
}

function forget(place) {
  unseen.delete(place);
  watcher.unobserve(place);
}

/** Draw a figure now. Its place has its height: where the window changes, the package takes the height from there. */
function draw(place, traces, figure, config = CONFIG) {
  place.style.height = `${figure.height}px`;
  pending.set(place, Plotly.react(place, traces, figure, config));
}

/** Give up a figure, once its last drawing has ended: the package still reads what it draws. */
function retire(place) {
  forget(place);
  if (!pending.has(place)) return;
  const free = () => Plotly.purge(place);
  Promise.resolve(pending.get(place)).then(free, free);
}
