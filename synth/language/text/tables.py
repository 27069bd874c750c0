"""Tables of the French normaliser: abbreviations, units, currencies, sigles, letters, signs."""

import re

LETTER_NAMES = {
    "a": "a", "b": "bé", "c": "cé", "d": "dé", "e": "e", "f": "effe", "g": "gé", "h": "ache",
    "i": "i", "j": "ji", "k": "ka", "l": "elle", "m": "emme", "n": "enne", "o": "o", "p": "pé",
    "q": "cu", "r": "erre", "s": "esse", "t": "té", "u": "u", "v": "vé", "w": "double vé",
    "x": "ixe", "y": "i grec", "z": "zède", "é": "é", "è": "è", "ç": "cé", "à": "a", "&": "et",
}  # fmt: skip

MONTHS = (
    "janvier février mars avril mai juin juillet août septembre octobre novembre décembre"
).split()

ABBREVIATIONS = (
    (r"\bMM\.(?= )", "messieurs"),
    (r"\bM\.(?= et (?:M\.|Mme|Mlle))", "monsieur"),
    (
        r"\bM\.(?= ?[A-ZÉÈÀÂÎ])(?! ?[A-Z]\.)|\bM\.(?= (?:le |la |de |du |des |l'))|\bMr\b\.?",
        "monsieur",
    ),
    (r"\bMmes\b\.?", "mesdames"),
    (r"\bMme\b\.?", "madame"),
    (r"\bMlles\b\.?", "mesdemoiselles"),
    (r"\bMlle\b\.?", "mademoiselle"),
    (r"\bDrs\b\.?", "docteurs"),
    (r"\bDr\b\.?", "docteur"),
    (r"\bPr\b\.?(?= [A-ZÉ])", "professeur"),
    (r"\bMe\b(?= [A-ZÉ][a-z])", "maître"),
    (r"\bMgr\b\.?", "monseigneur"),
    (r"\bSte\b\.?(?=[ -][A-ZÉ])", "sainte"),
    (r"\bSt\b\.?(?=[ -][A-ZÉ])", "saint"),
    (r"\b[Nn]os ?(?=\d)|\b[Nn][°º]s ?(?=\d)", "numéros"),
    (r"\b[Nn] ?[°º] ?", "numéro"),
    (r"\b[Tt][ée]l\.", "téléphone"),
    (r"\bav\. (?=J\.?-? ?C\.?)", "avant"),
    (r"\bap\. (?=J\.?-? ?C\.?)", "après"),
    (r"\bJ\.?-? ?C\.?(?!\w)", "jésus-christ"),
    (r"\bav\.(?= [A-ZÉ])", "avenue"),
    (r"\b[Bb]d\b\.?(?= )", "boulevard"),
    (r"(?:\bet )?\betc\b\.*", "etcetera"),
    (r"\b[Ee]x[ -](?:æ|ae)quo\b", "exaequo"),
    (r"\bc\.?-à-d\b\.?", "c'est-à-dire"),
    (r"\bp\. ?ex\.", "par exemple"),
    (r"\b[Cc]f\.", "confer"),
    (r"\benv\.(?= )", "environ"),
    (r"\bmax\.(?= |$)", "maximum"),
    (r"\bmin\.(?= [a-z])", "minimum"),
    (r"\bp\. ?(?=\d)", "page"),
    (r"\bpp\. ?(?=\d)", "pages"),
    (r"\bchap\. ?(?=[\dIVX])", "chapitre"),
    (r"\bvol\. ?(?=\d)", "volume"),
    (r"\bfig\. ?(?=\d)", "figure"),
    (r"\bart\. ?(?=\d)", "article"),
    (r"\b[Rr]dv\b\.?|\bRDV\b", "rendez-vous"),
    (r"\bsvp\b|\bSVP\b|\bS\.V\.P\.", "s'il vous plaît"),
    (r"\bqqch\b\.?|\bqqc\b\.?", "quelque chose"),
    (r"\bqqn\b\.?", "quelqu'un"),
    (r"\bdép\.(?= )", "département"),
    (r"\bgouv\.(?= )", "gouvernement"),
    (r"\bvs\b\.?", "contre"),
    (r"(?<=\d) ?(?:mn|min)\b\.?", "minutes"),
    (r"\b[Bb]ld\b\.?(?= )", "boulevard"),
    (r"\b[Ee]x\.(?= ?:)", "exemple"),
    (r"\b[Aa]ppt\b\.?", "appartement"),
    (r"\b[Tt]jrs\b|\b[Tt]js\b", "toujours"),
    (r"\b[Bb]cp\b", "beaucoup"),
    (r"\b[Pp]b\b(?!\.)", "problème"),
    (r"\bN\.?B\. ?(?=:|\w)", "nota bene"),
    (r"\bP\.?-?S\.(?= ?:)", "post-scriptum"),
    (r"\bcie\b|\bCie\b", "compagnie"),
    (r"\b4 ?[xX×] ?4\b", "quatre-quatre"),
    (
        r"(?<=\b(?i:un|en|ce|le|du|de|au)) jean\b|(?<=\b[MTSmts]on) jean\b"
        r"|(?<=\b(?i:notre|votre|vieux|petit)) jean\b",
        "djine",
    ),
    (r"\bjeans\b", "djine"),
)
"""Regular expressions and what they are read as, tried in this order."""

CURRENCIES = {
    "€": ("euro", "euros", False), "EUR": ("euro", "euros", False),
    "$": ("dollar", "dollars", False), "USD": ("dollar", "dollars", False),
    "£": ("livre", "livres", True), "CHF": ("franc suisse", "francs suisses", False),
    "F": ("franc", "francs", False), "¥": ("yen", "yens", False),
    "M€": ("million d'euros", "millions d'euros", False),
    **{f"{short}€": ("milliard d'euros", "milliards d'euros", False)
       for short in ("Md", "Mds", "Mrd", "Mrds", "Md ", "Mds ", "Mrd ", "Mrds ")},
    "M$": ("million de dollars", "millions de dollars", False),
    **{f"{short}$": ("milliard de dollars", "milliards de dollars", False)
       for short in ("Md", "Mds", "Md ", "Mds ")},
    "K€": ("kilo-euro", "kilo-euros", False),
    "k€": ("kilo-euro", "kilo-euros", False),
}  # fmt: skip
"""Sign to (singular, plural, feminine)."""

UNITS = {
    "km/h": ("kilomètre heure", "kilomètres heure", False),
    "m/s": ("mètre par seconde", "mètres par seconde", False),
    "km²": ("kilomètre carré", "kilomètres carrés", False),
    "km2": ("kilomètre carré", "kilomètres carrés", False),
    "m²": ("mètre carré", "mètres carrés", False),
    "m2": ("mètre carré", "mètres carrés", False),
    "m³": ("mètre cube", "mètres cubes", False),
    "m3": ("mètre cube", "mètres cubes", False),
    "cm²": ("centimètre carré", "centimètres carrés", False),
    "km": ("kilomètre", "kilomètres", False), "m": ("mètre", "mètres", False),
    "dm": ("décimètre", "décimètres", False), "cm": ("centimètre", "centimètres", False),
    "mm": ("millimètre", "millimètres", False), "µm": ("micromètre", "micromètres", False),
    "kg": ("kilogramme", "kilogrammes", False), "g": ("gramme", "grammes", False),
    "mg": ("milligramme", "milligrammes", False), "t": ("tonne", "tonnes", True),
    "l": ("litre", "litres", False), "L": ("litre", "litres", False),
    "cl": ("centilitre", "centilitres", False), "ml": ("millilitre", "millilitres", False),
    "hl": ("hectolitre", "hectolitres", False), "ha": ("hectare", "hectares", False),
    "s": ("seconde", "secondes", True), "ms": ("milliseconde", "millisecondes", True),
    "°C": ("degré celsius", "degrés celsius", False), "°": ("degré", "degrés", False),
    "%": ("pour cent", "pour cent", False), "‰": ("pour mille", "pour mille", False),
    "Hz": ("hertz", "hertz", False), "kHz": ("kilohertz", "kilohertz", False),
    "MHz": ("mégahertz", "mégahertz", False), "GHz": ("gigahertz", "gigahertz", False),
    "W": ("watt", "watts", False), "kW": ("kilowatt", "kilowatts", False),
    "MW": ("mégawatt", "mégawatts", False), "kWh": ("kilowatt heure", "kilowatt heures", False),
    "hPa": ("hectopascal", "hectopascals", False), "Pa": ("pascal", "pascals", False),
    "kPa": ("kilopascal", "kilopascals", False), "kcal": ("kilocalorie", "kilocalories", True),
    "kV": ("kilovolt", "kilovolts", False), "GW": ("gigawatt", "gigawatts", False),
    "TWh": ("térawatt heure", "térawatt heures", False), "dl": ("décilitre", "décilitres", False),
    "GWh": ("gigawatt heure", "gigawatt heures", False),
    "MWh": ("mégawatt heure", "mégawatt heures", False), "Mt": ("mégatonne", "mégatonnes", True),
    "ch": ("cheval", "chevaux", False), "CV": ("cheval", "chevaux", False),
    "V": ("volt", "volts", False), "dB": ("décibel", "décibels", False),
    "Ko": ("kilo-octet", "kilo-octets", False), "Mo": ("méga-octet", "méga-octets", False),
    "Go": ("giga-octet", "giga-octets", False), "To": ("téra-octet", "téra-octets", False),
}  # fmt: skip
"""Sign to (singular, plural, feminine)."""

SYMBOLS = {
    "&": "et", "%": "pour cent", "€": "euros", "$": "dollars", "£": "livres", "+": "plus",
    "=": "égale", "<": "inférieur à", ">": "supérieur à", "@": "arobase", "#": "dièse",
    "°": "degré", "½": "un demi", "¼": "un quart", "¾": "trois quarts", "²": "au carré",
    "³": "au cube", "§": "paragraphe", "×": "fois", "÷": "divisé par", "±": "plus ou moins",
}  # fmt: skip
"""Signs that no other rule took, and how they are read."""

SPOKEN_SIGLES = frozenset(
    "onu otan unesco unicef nasa sida ovni pacs smic urssaf opep insee inserm ena enarque cnil "
    "fnac ikea fifa uefa feder erasmus laser radar sonar zep zac sicav sacem assedic benelux "
    "oulipo inra inrae ademe cedex capes crous deug bac fac imax cac led medef samu raid ina eta "
    "ira fiv caf ehpad amap unsa unef insa essec cnes cern giec cop covid sras losc var dom tom "
    "sud arcom hadopi ram crif licra afnor anses apec cimade cnaf cnam creps daech darpa dreal "
    "ddass esat gafa gafam garf gatt ibis lol mercosur nafta ovh pisa rib sacd sagem segpa sernam "
    "sivom sofres spip swift tracfin unapei velux zad zup basf fiat seat saab asean brics pel dab "
    "fed bafa bep afpa unedic bafta oscar césar fémis celsa ifop ipsos insep cada cafat crédoc "
    "ifremer irsem onisep onera snes cnosf".split()
)
"""Sigles that are said as words; the others of at most four letters are spelled."""

SPELLED_SIGLES = frozenset(
    "usa anpe eelv spa ars chu chr pib cap sav pao cao ist bri ter us uk udi cia ag ens iut ufr "
    "cea hec epr rer pme pmi tpe eti ong omc oms ocde osce fmi bce ue uem pes ps pcf npa lr lfi "
    "rn fn sdf rmi rsa hlm pv pdg dg bd tp td cv rh drh dsi vo vf vost hd uhd ia ip sms url gp "
    "gpa pma ivg adn arn vih atp uci cio aja asse om ol og asm usap jo ko qi qg qcm iss esa rda "
    "rfa urss dea nsa fsb tva apl ape api irm ecg eeg orl avc mst opj gav csa bfm lci dst dgse "
    "bts".split()
)
"""Sigles that look like words and are spelled all the same."""

FEMININE_NOUNS = frozenset(
    "heure heures minute minutes seconde secondes livre livres tonne tonnes personne personnes "
    "fois femme femmes fille filles année années semaine semaines journée journées page pages "
    "voiture voitures maison maisons chose choses raison raisons ville villes nuit nuits".split()
)
"""Nouns before which a number that ends in one says une, beside those of `FEMININE_ENDING`."""

FEMININE_ENDING = re.compile(
    r".+(?:[tsg]ion|[^mv]ité|ette|[^l]ance|[lv]ence|euse|trice|ière|elle|enne|[cdtlvx]ure|esse|ade)s"
)
"""Endings of nouns that are feminine with few exceptions."""
