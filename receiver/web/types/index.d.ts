import type { Diagnosis, Placement } from "./decoder.js";

/** A key that the cuer makes; times are seconds of the programme. */
export interface CuecastKey {
  start: number;
  end: number;
  shape: number;
  placement: Placement;
  phones: string[];
}

export interface CuecastState {
  /** `deaf`: the page cannot hear or find a cuer, `reason` and `text` say why. */
  state: Diagnosis["state"] | "deaf";
  reason: string;
  text: string;
}

export interface CuecastPlayerEvents {
  key: CustomEvent<CuecastKey>;
  state: CustomEvent<CuecastState>;
  lost: CustomEvent<{ time: number; count: number }>;
  verified: CustomEvent<{ time: number; of: string }>;
}

export class CuecastPlayer extends HTMLElement {
  readonly media: HTMLMediaElement | null;
  base: string;
  readonly keyList: CuecastKey[];
  readonly reason: string;
  readonly diagnosis?: Diagnosis;
  addEventListener<K extends keyof CuecastPlayerEvents>(
    type: K, listener: (event: CuecastPlayerEvents[K]) => void, options?: boolean | AddEventListenerOptions,
  ): void;
  addEventListener(
    type: string, listener: EventListenerOrEventListenerObject, options?: boolean | AddEventListenerOptions,
  ): void;
}

declare global {
  interface HTMLElementTagNameMap {
    "cuecast-player": CuecastPlayer;
  }
}
