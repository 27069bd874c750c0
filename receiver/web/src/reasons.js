/** Why there is no cuer: every reason that a player can give, in the page's languages. */

/** @type {Record<string, Words>} */
export const REASONS = {
  "no-media": {
    en: "There is no <video> or <audio> inside the player.",
    fr: "Le lecteur ne contient ni <video> ni <audio>.",
  },
  "other-origin": {
    en: "The programme comes from another site, and a page may not hear such sound. Serve it from the page's own site, or with Access-Control-Allow-Origin and crossorigin=\"anonymous\", or put its .cue file beside it.",
    fr: "Le programme vient d'un autre site : la page n'a pas le droit d'en entendre le son.",
  },
  insecure: {
    en: "The page came without https, and browsers let such a page read sound on localhost only.",
    fr: "La page est venue sans https : le navigateur ne lui laisse lire le son que sur localhost.",
  },
  "no-worklet": {
    en: "This browser has no AudioWorklet.",
    fr: "Ce navigateur n'offre pas AudioWorklet.",
  },
  "no-module": {
    en: "This browser cannot run the receiver (WebAssembly with SIMD).",
    fr: "Ce navigateur ne peut pas exécuter le récepteur (WebAssembly avec SIMD).",
  },
  "no-files": {
    en: "Files of the player are missing: cuecast.wasm, voice.bin and voice.json belong beside its script.",
    fr: "Des fichiers du lecteur manquent à côté de son script.",
  },
  "no-file": {
    en: "The stream file that the player's attribute cue names is missing, damaged or of another voice.",
    fr: "Le fichier .cue que nomme l'attribut cue manque, est abîmé ou d'une autre voix.",
  },
  "no-key": {
    en: "The broadcaster's public file that the player's attribute trust names is missing.",
    fr: "Le fichier public du diffuseur que nomme l'attribut trust manque.",
  },
  asleep: {
    en: "The browser lets the page hear only after a click or a key press.",
    fr: "Le navigateur attend un clic ou une touche avant de laisser la page entendre.",
  },
  muted: {
    en: "The programme is muted: the cuer travels in its sound.",
    fr: "Le son est coupé, et la codeuse voyage dans le son.",
  },
  speed: {
    en: "At another speed than 1 the cuer cannot be heard; cues heard before are still shown.",
    fr: "À une autre vitesse que 1, la codeuse n'est pas reçue ; ce qui fut reçu reste visible.",
  },
  silence: {
    en: "The programme plays, but the page hears silence: it has no sound, or a redirection to another site.",
    fr: "Le programme joue, mais la page n'entend que du silence.",
  },
  "no-mark": {
    en: "There is sound, but no cuer was found in it so far.",
    fr: "Il y a du son, mais aucune codeuse n'y a été trouvée.",
  },
  "other-voice": {
    en: "The programme has a cuer of another voice or of another version of the format.",
    fr: "La codeuse de ce programme est d'une autre voix ou d'une autre version.",
  },
  failed: {
    en: "The receiver failed; the console has its words.",
    fr: "Le récepteur a échoué ; la console dit pourquoi.",
  },
};
