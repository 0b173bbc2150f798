// Numbers as engineers write them: N, mm, degrees. Everything in the data is SI.

const MINUS = '\u2212';
export const NONE = '\u2013';

/** `value` with `digits` significant digits, without exponents where a plain number is readable. */
export function number(value, digits = 3) {
  if (value === Infinity) return '\u221e';
  if (!Number.isFinite(value)) return NONE;
  if (value === 0) return '0';
  const size = Math.abs(value);
  let text;
  if (size >= 10 ** Math.max(digits, 5) * 10 || size < 1e-4) {
    const [mantissa, exponent] = value.toExponential(digits - 1).split('e');
    text = `${mantissa}\u00b710${[...String(Number(exponent))].map((c) => (c === '-' ? '\u207b' : '\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079'[c])).join('')}`;
  } else {
    const decimals = Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
    text = value.toFixed(Math.min(decimals, 8));
  }
  return text.replace('-', MINUS);
}

/** As `number`, without trailing zeros: for values that someone chose rather than measured. */
export const chosen = (value, digits = 4) => {
  const text = number(value, digits);
  return text.includes('.') && !text.includes('\u00b7') ? text.replace(/\.?0+$/, '') : text;
};

/** Fixed decimals, for columns in which the points should line up. */
export const fixed = (value, decimals) => (Number.isFinite(value) ? value.toFixed(decimals).replace('-', MINUS) : value === Infinity ? '\u221e' : NONE);

/** Whole numbers with thin spaces between thousands. */
export const count = (value) => String(Math.round(value)).replace(/\B(?=(\d{3})+$)/g, '\u202f');

/** Metres as millimetres without unit; below a thousandth of a micrometre there is only rounding. */
export const inMm = (metres, digits = 3) => number(Math.abs(metres) < 1e-9 ? 0 : metres * 1e3, digits);
export const mm = (metres, digits = 3) => (Number.isFinite(metres) ? `${inMm(metres, digits)}\u00a0mm` : NONE);
export const degrees = (radians, digits = 3) => (Number.isFinite(radians) ? `${number((radians * 180) / Math.PI, digits)}\u00b0` : NONE);
export const newtons = (value, digits = 3) => (Number.isFinite(value) ? `${number(value, digits)}\u00a0N` : NONE);
export const percent = (value) => (Number.isFinite(value) ? `${fixed(value * 100, value > 0.9995 || value < 0.0005 ? 0 : 1)}\u00a0%` : NONE);
export const mass = (kg) => (!Number.isFinite(kg) ? NONE : kg < 1 ? `${number(kg * 1e3)}\u00a0g` : `${number(kg)}\u00a0kg`);

/** Divisor and name of the pressure unit that suits values up to `largest` [Pa]. */
export function pressureUnit(largest) {
  if (largest >= 1e6) return [1e6, 'MPa'];
  if (largest >= 1e3) return [1e3, 'kPa'];
  return [1, 'Pa'];
}

/** `part_interference` -> `Part interference`. */
export const words = (name) => {
  const text = String(name).replaceAll('_', ' ').replace(/:(?=\S)/g, ': ');
  return text.charAt(0).toUpperCase() + text.slice(1);
};

/** A step of 1, 2 or 5 times a power of ten not above `largest`. */
export function niceStep(largest) {
  const power = 10 ** Math.floor(Math.log10(largest));
  const lead = largest / power;
  return power * (lead >= 5 ? 5 : lead >= 2 ? 2 : 1);
}
