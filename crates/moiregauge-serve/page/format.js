// Numbers as the program prints them: two digits of the error decide the digits of the value.

/** @typedef {{value: number, sigma?: number, sigma_total?: number}} Estimate */

const MINUS = "\u2212";

/**
 * Digits after the point that two significant digits of an error ask for.
 * @param {number} sigma
 */
function digits(sigma) {
  if (!(sigma > 0) || !Number.isFinite(sigma)) return null;
  const rounded = Number(sigma.toPrecision(2));
  return Math.min(12, Math.max(0, 1 - Math.floor(Math.log10(rounded))));
}

/** A number with a true minus sign. @param {string} text */
export function minus(text) {
  return text.replace(/-/g, MINUS);
}

/**
 * Value and error.
 * @param {number | null | undefined} value
 * @param {number | null | undefined} sigma
 * @param {string} [unit]
 */
export function withError(value, sigma, unit = "") {
  if (value === null || value === undefined || !Number.isFinite(value)) return "not determined";
  const n = digits(sigma ?? NaN);
  if (n === null) return number(value) + space(unit);
  return `${minus(value.toFixed(n))} ± ${(sigma ?? 0).toFixed(n)}${space(unit)}`;
}

/**
 * An estimate with its total error, or the statistical one where there is no other.
 * @param {Estimate | null | undefined} estimate
 * @param {string} [unit]
 */
export function total(estimate, unit = "") {
  if (!estimate) return "not determined";
  return withError(estimate.value, estimate.sigma_total ?? estimate.sigma, unit);
}

/**
 * An error alone.
 * @param {number | null | undefined} sigma
 * @param {string} [unit]
 */
export function plusMinus(sigma, unit = "") {
  const n = digits(sigma ?? NaN);
  return n === null ? "" : `± ${(sigma ?? 0).toFixed(n)}${space(unit)}`;
}

/**
 * A number with some significant digits, plain where it can be.
 * @param {number | null | undefined} value
 * @param {number} [significant]
 */
export function number(value, significant = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-6) return power(value, significant - 1);
  // JavaScript writes 1e-7 for what the program writes 0.0000001.
  const after = Math.max(0, significant - 1 - Math.floor(Math.log10(size)));
  const text = value.toFixed(Math.min(20, after));
  return minus(text);
}

/**
 * With a power of ten in words of the field: 2.8 × 10¹².
 * @param {number} value
 * @param {number} [after] digits after the point
 */
export function power(value, after = 2) {
  const [mantissa, exponent] = value.toExponential(after).split("e");
  const raised = String(Number(exponent)).replace(/[-0-9]/g, (c) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)]);
  return `${minus(mantissa)} × 10${raised}`;
}

/**
 * Blank before a unit, none before degrees.
 * @param {string} unit
 */
function space(unit) {
  return unit === "" ? "" : unit === "°" ? "°" : `\u202f${unit}`;
}

/** @param {number} value @param {string} unit @param {number} [significant] */
export function quantity(value, unit, significant = 4) {
  return number(value, significant) + space(unit);
}

/** @param {number} bytes */
export function size(bytes) {
  if (bytes < 1000) return `${bytes} B`;
  if (bytes < 1e6) return `${(bytes / 1e3).toFixed(0)} kB`;
  return bytes < 1e9 ? `${(bytes / 1e6).toFixed(1)} MB` : `${(bytes / 1e9).toFixed(2)} GB`;
}

/** A key of the settings or results in words. @param {string} key */
export function words(key) {
  return key.replace(/_/g, " ");
}

/** The greatest of 1, 2, 5 × 10ⁿ that is no greater. @param {number} length */
export function roundBelow(length) {
  const decade = 10 ** Math.floor(Math.log10(length));
  const leading = length / decade;
  return (leading >= 5 ? 5 : leading >= 2 ? 2 : 1) * decade;
}
