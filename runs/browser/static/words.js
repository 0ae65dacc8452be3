"use strict";
// Numbers, labels and elements. All texts of users go through `element` (as text, never as HTML) or `plotText`.

const MINUS = "\u2212";
const DIGIT_SPACE = "\u2007", POINT_SPACE = "\u2008"; // as wide as a digit and as a point

/** A number with some significant digits; "-" where there is none; a word as it is. */
function number(value, digits = 6) {
  if (typeof value === "string") return value;
  if (value === null || value === undefined || Number.isNaN(value)) return "-";
  if (value === 0) return "0";
  const size = Math.abs(value);
  const text = size >= 1e-3 && size < 1e7 ? trimmed(value.toPrecision(digits)) : value.toExponential(Math.max(digits - 1, 0));
  return text.replace(/^-/, MINUS).replace(/e-/, `e${MINUS}`).replace(/e\+/, "e");
}

function trimmed(text) {
  return text.includes("e") ? String(Number(text)) : text.replace(/(\.\d*?)0+$/, "$1").replace(/\.$/, "");
}

/** An error: two digits. */
const small = (value) => (value === null || value === undefined ? "-" : value === 0 ? "0" : number(Number(value.toExponential(1)), 2));

/** A column of numbers with the same number of decimals: six digits of the largest, and at least four of their range. */
function column(values) {
  const finite = values.filter(Number.isFinite);
  if (!finite.length) return values.map(() => "-");
  const largest = Math.max(...finite.map(Math.abs));
  if (largest && (largest < 1e-3 || largest >= 1e8)) return values.map((value) => number(value, 6));
  const decade = (value) => (value ? Math.floor(Math.log10(value)) : 0);
  const span = Math.max(...finite) - Math.min(...finite);
  let decimals = 5 - decade(largest);
  if (span > 1e-9 * largest) decimals = Math.max(decimals, 3 - decade(span));
  decimals = Math.min(Math.max(decimals, 0), 11 - decade(largest));
  // Numbers with fewer than five digits have more decimals, unless they are round-off of the largest; decimal points stay below each other.
  const small = (value) => Number.isFinite(value) && value !== 0 && Math.abs(value) >= 1e-6 * largest;
  const own = values.map((value) => (small(value) ? Math.max(decimals, 4 - decade(Math.abs(value))) : decimals));
  const width = Math.max(decimals, ...own);
  const rest = (n) => (n === 0 && width > 0 ? POINT_SPACE : "") + DIGIT_SPACE.repeat(width - n);
  return values.map((value, k) => (Number.isFinite(value) ? (value + 0).toFixed(own[k]).replace(/^-/, MINUS) + rest(own[k]) : "-"));
}

/** Decimals of numbers that are known within a tolerance, at least four digits of their range; null where that is not known, or they are equal. */
function decimalsWithin(values, tolerance) {
  const [low, high] = extent(values);
  const largest = Math.max(Math.abs(low), Math.abs(high));
  if (!(tolerance > 0 && high - low > tolerance) || largest < 1e-3 || largest >= 1e8) return null;
  const decade = (value) => Math.floor(Math.log10(value));
  return Math.min(Math.max(-decade(tolerance), 3 - decade(high - low), 0), 11 - decade(largest));
}

/** A number with so many decimals; without them with six digits. */
const fixed = (value, decimals) => (decimals === null || !Number.isFinite(value) ? number(value) : value.toFixed(decimals).replace(/^-(?=[0.]*$)/, "").replace("-", MINUS));

const withUnit = (name, unit) => (unit ? `${name} [${unit}]` : name);
const grouped = (count) => String(count).replace(/\B(?=(\d{3})+$)/g, "\u202f");
const counted = (count, what) => `${grouped(count)} ${what}${count === 1 ? "" : "s"}`;

/** The limits of a quantity in words. */
function limitsText(lower, upper) {
  if (lower === null && upper === null) return "";
  if (lower === null) return `\u2264 ${number(upper, 5)}`;
  if (upper === null) return `\u2265 ${number(lower, 5)}`;
  return lower === upper ? `= ${number(lower, 5)}` : `in [${number(lower, 5)}, ${number(upper, 5)}]`;
}

/** A text as the drawing package shows it: it reads some HTML, and must not read it in names. */
const plotText = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;").replace(/\$/g, "&#36;");

/** The label of an objective's axis, with an arrow towards better values. */
function goalLabel(goal) {
  const text = plotText(withUnit(goal.name, goal.unit));
  return goal.sense === "minimize" ? `\u2190 ${text}` : `${text} \u2192`;
}

/** An element with attributes and children; strings become text. */
function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else made.setAttribute(name, value === true ? "" : value);
  }
  made.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return made;
}

const byId = (id) => document.getElementById(id);

/** Replace what is in an element. */
function fill(place, ...children) {
  place.replaceChildren(...children.flat().filter((child) => child !== null && child !== undefined));
}

/** Build a part of the page anew; what has the focus in it keeps it. */
function rebuilt(place, build) {
  const active = document.activeElement;
  if (!place.contains(active)) return build();
  const all = () => [...place.querySelectorAll("button, input, select, summary, [tabindex]")];
  const row = active.closest("tr[data-key]")?.dataset.key, position = all().indexOf(active);
  build();
  if (place.contains(document.activeElement)) return;
  if (row) focusRow([...place.querySelectorAll("tr[data-key]")].find((one) => one.dataset.key === row) ?? null);
  else all()[position]?.focus({ preventScroll: true });
}

/** A label with a select element; `options` are pairs of value and text. */
function choice(text, options, value, chosen) {
  const select = element("select", { onchange: () => chosen(select.value) });
  for (const [key, words] of options) select.append(element("option", { value: key, selected: String(key) === String(value) }, words));
  return element("label", {}, `${text} `, select);
}
