// Light, dark, or as the system says. The choice is kept where the browser allows it.

const KEY = 'gripfast-theme';
const NAMES = ['auto', 'light', 'dark'];

/** Runs the three-way switch in `root` and calls `change(dark)` at once and on every change. */
export function theme(root, change) {
  const system = window.matchMedia('(prefers-color-scheme: dark)');
  let chosen = 'auto';
  try {
    chosen = localStorage.getItem(KEY) ?? 'auto';
  } catch {
    // Storage is refused to some local files: the choice then lasts as long as the page.
  }
  if (!NAMES.includes(chosen)) chosen = 'auto';
  const apply = () => {
    const dark = chosen === 'dark' || (chosen === 'auto' && system.matches);
    document.documentElement.dataset.theme = dark ? 'dark' : 'light';
    root.querySelectorAll('input').forEach((input) => (input.checked = input.value === chosen));
    change(dark);
  };
  root.addEventListener('change', (event) => {
    chosen = event.target.value;
    try {
      localStorage.setItem(KEY, chosen);
    } catch {
      // As above.
    }
    apply();
  });
  system.addEventListener('change', apply);
  apply();
}
