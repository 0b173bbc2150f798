// The part's axes in the corner of the view, turning with it.

const SVG = 'http://www.w3.org/2000/svg';
const REACH = 25;

/** Puts an axis cross into `svg` and returns the function that turns it by the rows (right, up, out) of the view. */
export function triad(svg) {
  const axes = ['x', 'y', 'z'].map((name) => {
    const group = document.createElementNS(SVG, 'g');
    group.setAttribute('class', `axis-${name}`);
    const line = group.appendChild(document.createElementNS(SVG, 'line'));
    const text = group.appendChild(document.createElementNS(SVG, 'text'));
    text.textContent = name;
    return { group, line, text };
  });
  return ([right, up, out]) => {
    axes.forEach(({ line, text }, k) => {
      const [x, y] = [right[k] * REACH, -up[k] * REACH];
      line.setAttribute('x2', x);
      line.setAttribute('y2', y);
      text.setAttribute('x', x * 1.32);
      text.setAttribute('y', y * 1.32);
    });
    // Axes that point at the viewer are drawn over the others.
    svg.append(...[0, 1, 2].sort((a, b) => out[a] - out[b]).map((k) => axes[k].group));
  };
}
