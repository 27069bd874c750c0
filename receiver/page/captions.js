/**
 * The programme's text beside the cuer: the cues of one of the media's text tracks, which the browser
 * times, or pictures of text that a broadcast sends (DVB subtitles).
 *
 * They are put where the layout has room for them.
 */

/** Pictures that wait for their time, at most: a broadcast sends them seconds ahead. */
const MOST_PICTURES = 20;

export class Captions {
  /** @param {HTMLMediaElement} video @param {HTMLElement} box where the text goes */
  constructor(video, box) {
    this.video = video;
    this.box = box;
    /** @type {TextTrack | null} */
    this.track = null;
    /** @type {{startS: number, endS: number, image: HTMLImageElement | null}[]} */
    this.pictures = [];
    /** @type {HTMLImageElement | null} */
    this.shown = null;
    video.textTracks.addEventListener("addtrack", () => this.choose());
    video.textTracks.addEventListener("removetrack", () => this.choose());
    this.choose();
  }

  /** Whether the programme has any text. */
  get present() {
    return this.track !== null || this.pictures.length > 0;
  }

  /**
   * Keep a broadcast's `{start_s, end_s, png}`; an empty picture ends the one before.
   * @param {{start_s: number, end_s: number, png: string}} caption @param {string} name
   */
  insert({ start_s: startS, end_s: endS, png }, name) {
    const image = png ? Object.assign(new Image(), { src: `data:image/png;base64,${png}`, alt: name }) : null;
    this.pictures = [...this.pictures.filter((picture) => picture.startS < startS), { startS, endS, image }].slice(-MOST_PICTURES);
  }

  /** Show the picture of a time, if the programme has no track of text. @param {number} timeS */
  showAt(timeS) {
    if (this.track) return;
    const now = this.pictures.filter(({ startS }) => startS <= timeS).pop();
    const image = now && timeS < now.endS ? now.image : null;
    if (image === this.shown) return;
    this.shown = image;
    this.box.replaceChildren(...(image ? [image] : []));
  }

  /** Take the French track, else the first; the browser is not to show it itself. */
  choose() {
    const tracks = Array.from(this.video.textTracks).filter(({ kind }) => kind === "captions" || kind === "subtitles");
    const chosen = tracks.find(({ language }) => language.startsWith("fr")) || tracks[0] || null;
    for (const track of tracks) track.mode = track === chosen ? "hidden" : "disabled";
    if (chosen === this.track) return;
    if (this.track) this.track.oncuechange = null;
    this.track = chosen;
    if (chosen) chosen.oncuechange = () => this.write();
    this.write();
  }

  write() {
    const cues = Array.from(this.track?.activeCues || []);
    this.box.replaceChildren(...cues.map((cue) => {
      const line = document.createElement("p");
      const text = document.createElement("span");
      text.append(/** @type {VTTCue} */ (cue).getCueAsHTML());
      line.append(text);
      return line;
    }));
  }
}
