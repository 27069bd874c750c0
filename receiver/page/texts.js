/** Every word on the page, in French and English. */

/** @type {Record<string, Words>} */
export const TEXTS = {
  fr: {
    cuer: "Codeuse en langue française parlée complétée", keysLine: "Clés codées", controls: "Commandes",
    play: "Lecture", pause: "Pause", stepBack: "Image précédente", stepForward: "Image suivante",
    seek: "Position dans le programme", speed: "Vitesse", style: "Style de la codeuse", handOnly: "Main seule",
    settings: "Réglages", full: "Plein écran", keyboard: "Clavier et télécommande",
    appearance: "Apparence", woman: "Femme", man: "Homme", elder: "Femme âgée",
    points: "Points", avatar: "Avatar", place: "Emplacement", size: "Taille", mirror: "Gaucher (miroir)",
    opacity: "Opacité", contrast: "Contraste", keys: "Afficher les clés", language: "Langue", dot: "Taille des points",
    layout: "Disposition", beside: "À côté du programme", over: "Sur le programme", free: "Libre (glisser)",
    left: "De gauche à droite", top: "De haut en bas", width: "Largeur", delay: "Retard de la codeuse",
    captions: "Sous-titres", ground: "Fond des sous-titres", shade: "Voilé", box: "Noir", none: "Sans",
    absent: "Pas de codeuse dans ce programme", searched: "recherchée sur",
    "bottom-right": "En bas à droite", "bottom-left": "En bas à gauche", "top-right": "En haut à droite",
    "top-left": "En haut à gauche", small: "Petite", medium: "Moyenne", large: "Grande", whole: "Plein écran, programme en vignette",
    panel: "Fond sombre", outline: "Contour, sans fond", strong: "Fort contraste",
    connecting: "Connexion…", searching: "Recherche de la codeuse…", locked: "Codeuse reçue",
    degraded: "Réception affaiblie", lost: "Signal perdu", ended: "Fin du programme",
    offline: "Récepteur injoignable", crowded: "Trop de pages regardent déjà",
    verified: "authentique", unknown: "origine inconnue", forged: "falsifiée", unsigned: "non signée", failed: "Lecture impossible", awaiting: "En attente de la codeuse",
    recoded: "Image recodée pour ce navigateur", unseen: "Image illisible, son et codeuse seuls",
    "help-play": "lecture ou pause", "help-seek": "reculer, avancer de 5 s", "help-step": "image par image",
    "help-speed": "moins vite, plus vite", "help-style": "points ou avatar", "help-hand": "main seule",
    "help-place": "changer de coin", "help-size": "changer de taille", "help-mirror": "miroir", "help-focus": "aller aux commandes",
    "help-layout": "à côté ou dessus", "help-captions": "sous-titres",
    "help-keys": "clés", "help-full": "plein écran", "help-language": "English", "help-settings": "ces réglages",
    green: "vert", red: "rouge", yellow: "jaune", blue: "bleu",
    rest: "repos", side: "côté", mouth: "bouche", chin: "menton", cheek: "pommette", throat: "gorge",
  },
  en: {
    cuer: "Cuer in French Cued Speech", keysLine: "Keys being cued", controls: "Controls",
    play: "Play", pause: "Pause", stepBack: "Previous picture", stepForward: "Next picture",
    seek: "Position in the programme", speed: "Speed", style: "Style of the cuer", handOnly: "Hand only",
    settings: "Settings", full: "Full screen", keyboard: "Keyboard and remote control",
    appearance: "Appearance", woman: "Woman", man: "Man", elder: "Elderly woman",
    points: "Points", avatar: "Avatar", place: "Place", size: "Size", mirror: "Left-handed (mirror)",
    opacity: "Opacity", contrast: "Contrast", keys: "Show the keys", language: "Language", dot: "Size of the points",
    layout: "Layout", beside: "Beside the programme", over: "Over the programme", free: "Free (drag her)",
    left: "From left to right", top: "From top to bottom", width: "Width", delay: "Delay of the cuer",
    captions: "Captions", ground: "Ground of captions", shade: "Shaded", box: "Black", none: "None",
    absent: "No cuer in this programme", searched: "searched for",
    "bottom-right": "Bottom right", "bottom-left": "Bottom left", "top-right": "Top right",
    "top-left": "Top left", small: "Small", medium: "Medium", large: "Large", whole: "Full screen, programme small",
    panel: "Dark panel", outline: "Outline, no panel", strong: "Strong contrast",
    connecting: "Connecting…", searching: "Searching for the cuer…", locked: "Cuer received",
    degraded: "Weak reception", lost: "Signal lost", ended: "End of the programme",
    offline: "Receiver unreachable", crowded: "Too many pages are watching",
    verified: "authentic", unknown: "origin unknown", forged: "forged", unsigned: "not signed", failed: "Cannot play the programme", awaiting: "Waiting for the cuer",
    recoded: "Picture recoded for this browser", unseen: "Picture cannot be shown, sound and cuer only",
    "help-play": "play or pause", "help-seek": "5 s back, forward", "help-step": "picture by picture",
    "help-speed": "slower, faster", "help-style": "points or avatar", "help-hand": "hand only",
    "help-place": "next corner", "help-size": "next size", "help-mirror": "mirror", "help-focus": "go to the controls",
    "help-layout": "beside or over", "help-captions": "captions",
    "help-keys": "keys", "help-full": "full screen", "help-language": "français", "help-settings": "these settings",
    green: "green", red: "red", yellow: "yellow", blue: "blue",
    rest: "rest", side: "side", mouth: "mouth", chin: "chin", cheek: "cheek", throat: "throat",
  },
};

/** Name every control in `language`: accessible names, tooltips and headings. @param {HTMLElement} root @param {string} language */
export function label(root, language) {
  const words = TEXTS[language];
  root.lang = language;
  for (const element of /** @type {NodeListOf<HTMLElement>} */ (root.querySelectorAll("[data-name]"))) {
    element.setAttribute("aria-label", words[element.dataset.name || ""]);
    if (element.tagName === "BUTTON") element.title = words[element.dataset.name || ""];
  }
  for (const element of /** @type {NodeListOf<HTMLElement>} */ (root.querySelectorAll("[data-text]"))) element.textContent = words[element.dataset.text || ""];
  return words;
}
