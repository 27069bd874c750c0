/**
 * Putting the cuer where the viewer wants her: dragged by her box, resized by its corner.
 *
 * Everything that dragging does, the settings' sliders do as well (WCAG 2.2, 2.5.7).
 */

const LEAST_PERCENT = 10;

/** @param {number} share */
const percent = (share) => Math.round(100 * Math.max(0, Math.min(1, share)));

export class Moving {
  /** @param {PageStage} stage @param {PageSettings} settings */
  constructor(stage, settings) {
    this.stage = stage;
    this.settings = settings;
    this.from = null;
    const { inset } = stage;
    inset.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => this.grasp(event));
    inset.addEventListener("pointermove", (/** @type {PointerEvent} */ event) => this.drag(event));
    for (const name of ["pointerup", "pointercancel"]) inset.addEventListener(name, () => { this.from = null; });
  }

  /** @param {PointerEvent} event */
  grasp(event) {
    const { layout, inset } = this.stage;
    if (layout.kind !== "over") return;
    inset.setPointerCapture(event.pointerId);
    this.from = { x: event.clientX, y: event.clientY, cuer: layout.cuer, resizes: /** @type {HTMLElement} */ (event.target).id === "corner" };
    event.preventDefault();
  }

  /** @param {PointerEvent} event */
  drag(event) {
    if (!this.from) return;
    const { cuer, resizes } = this.from;
    const { programme } = this.stage.layout;
    const x = event.clientX - this.from.x;
    const y = event.clientY - this.from.y;
    const width = resizes ? Math.max(cuer.width + x, LEAST_PERCENT / 100 * programme.width) : cuer.width;
    const height = width * cuer.height / cuer.width;
    /** @param {number} start @param {number} moved @param {number} room */
    const at = (start, moved, room) => (room > 0 ? percent((start + moved) / room) : 0);
    this.settings.setAll({
      place: "free",
      width: percent(width / programme.width),
      left: at(cuer.left - programme.left, resizes ? 0 : x, programme.width - width),
      top: at(cuer.top - programme.top, resizes ? 0 : y, programme.height - height),
    });
  }
}
