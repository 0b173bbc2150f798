// What is taken along from the page.

/** Puts `text` on the clipboard, and says on `button` whether that worked. */
export async function copy(text, button) {
  const name = (button.dataset.name ??= button.textContent);
  let done = true;
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    // Refused to some local files: the older way asks nobody.
    const area = document.body.appendChild(document.createElement('textarea'));
    area.value = text;
    area.select();
    done = document.execCommand('copy');
    area.remove();
    button.focus();
  }
  button.textContent = done ? 'Copied' : 'Copying was refused';
  clearTimeout(button.clock);
  button.clock = setTimeout(() => (button.textContent = name), 1500);
}
