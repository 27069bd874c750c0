/** How reception stands. */
export interface Diagnosis {
  state: "searching" | "locked" | "degraded" | "lost" | "ended";
  heardS: number;
  levelsDbfs: number[];
  pilots: number;
  clockPpm: number;
  firstLockS: number;
  superframes: number;
  failed: number;
  secondFailed: number;
  proofs: number;
  forged: number;
  /** Arrival less the time on air of the last superframe checked; 0 without a clock. */
  ageS: number;
  authenticity: Authenticity;
}

/** Whose superframes are (spec/authentication.md). */
export type Authenticity = "unknown" | "verified" | "forged" | "unsigned";

export type Placement = "rest" | "side" | "mouth" | "chin" | "cheek" | "throat";

export interface DecodedKey {
  kind: "key" | "preview";
  timeS: number;
  /** 0 removes the key that was at this time. */
  durationS: number;
  shape: number;
  placement: Placement;
  final: boolean;
  previewed: boolean;
  phones: string[];
  revision: number;
}

export type DecodedEvent =
  | { kind: "state"; timeS: number; state: Diagnosis["state"] }
  | { kind: "lost"; timeS: number; count: number }
  | DecodedKey
  | { kind: "motion"; timeS: number; revision: number; layers: number; values: Float32Array }
  | { kind: "proof"; timeS: number; status: Authenticity; reason: number; ageS: number; of: string }
  | { kind: "unreadable"; timeS: number; identity: number; version: number };

export const PHONES: readonly string[];

/** The receiver: blocks of sound in, events out. */
export class Decoder {
  static create(
    module: BufferSource | WebAssembly.Module,
    voice: ArrayBuffer | Uint8Array | null,
    config: { rateHz: number; channels: number; startS?: number; history?: boolean },
  ): Promise<Decoder>;
  /** Check whose cues these are by a broadcaster's public file; throws if it is damaged. */
  trust(announcement: ArrayBuffer | Uint8Array, toleranceS?: number): void;
  /** The next sample of a broadcast arrives at `utcS`, seconds since 1970. */
  clock(utcS: number): void;
  /** Take one array of samples per channel, full scale 1, of any length. */
  push(planes: Float32Array[]): DecodedEvent[];
  flush(): DecodedEvent[];
  /** Take a stream file (.cue) in place of sound. */
  open(bytes: ArrayBuffer | Uint8Array): { startS: number; durationS: number; superframes: number };
  /** The events of its next 0.64 s; null behind its end. */
  read(): DecodedEvent[] | null;
  reset(startS: number): void;
  diagnosis(): Diagnosis;
  explain(): string;
}
