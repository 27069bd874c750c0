/**
 * The programme's text beside the cuer: the cues of one of the media's text tracks.
 *
 * The browser times them; here they are only written where the layout has room for them.
 */

export class Captions {
  /** @param {HTMLMediaElement} video @param {HTMLElement} box where the text goes */
  constructor(video, box) {
    this.video = video;
    this.box = box;
    this.track = null;
    video.textTracks.addEventListener("addtrack", () => this.choose());
    video.textTracks.addEventListener("removetrack", () => this.choose());
    this.choose();
  }

  /** Whether the programme has any text. */
  get present() {
    return this.track !== null;
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
