/**
 * Moving the focus with the four arrows of a remote control.
 *
 * Where nothing has the focus, left and right wind the programme, up and down lead to the bar of
 * controls. In the bar left and right go from button to button, up to the position, down back to
 * the picture. In the panel up and down go from choice to choice, left and right change it.
 */

/** @type {Record<number, string>} */
const CODES = { 37: "ArrowLeft", 38: "ArrowUp", 39: "ArrowRight", 40: "ArrowDown", 13: "Enter" };

/** Handle a key press; returns whether it was one of these moves. @param {Document} document @param {KeyboardEvent} event */
export function navigate(document, event) {
  const key = event.key && event.key !== "Unidentified" ? event.key : CODES[event.keyCode];
  const active = document.activeElement;
  const panel = /** @type {HTMLElement} */ (document.getElementById("panel"));
  if (!panel.hidden) return inPanel(panel, active, key);
  if (document.getElementById("bar")?.contains(active)) return inBar(document, active, key);
  if (key !== "ArrowUp" && key !== "ArrowDown") return false;
  document.getElementById("play")?.focus();
  return true;
}

/** @param {HTMLElement} panel @param {any} active @param {string} key */
function inPanel(panel, active, key) {
  const inputs = /** @type {NodeListOf<HTMLInputElement>} */ (panel.querySelectorAll("select, input"));
  const choices = [...inputs].filter((one) => !one.hidden);
  const at = choices.indexOf(active);
  if (key === "ArrowUp" || key === "ArrowDown") {
    const next = at + (key === "ArrowUp" ? -1 : 1);
    choices[Math.max(0, Math.min(choices.length - 1, next))].focus();
    return true;
  }
  if (at < 0) return false;
  if (active.tagName === "SELECT" && (key === "ArrowLeft" || key === "ArrowRight" || key === "Enter")) {
    const count = active.options.length;
    active.selectedIndex = (active.selectedIndex + (key === "ArrowLeft" ? count - 1 : 1)) % count;
    active.dispatchEvent(new Event("change"));
    return true;
  }
  if (active.type === "checkbox" && (key === "ArrowLeft" || key === "ArrowRight" || key === "Enter")) {
    active.click();
    return true;
  }
  return false;
}

/** @param {Document} document @param {any} active @param {string} key */
function inBar(document, active, key) {
  const buttons = [.../** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll("#bar .button:not([hidden])"))];
  const seek = /** @type {HTMLElement} */ (document.getElementById("seek"));
  const at = buttons.indexOf(active);
  if (key === "ArrowUp" && at >= 0 && !seek.hidden) seek.focus();
  else if (key === "ArrowDown" && active === seek) buttons[0].focus();
  else if (key === "ArrowUp" || key === "ArrowDown") active.blur();
  else if (at >= 0 && key === "ArrowLeft") buttons[Math.max(0, at - 1)].focus();
  else if (at >= 0 && key === "ArrowRight") buttons[Math.min(buttons.length - 1, at + 1)].focus();
  else return false;
  return true;
}
