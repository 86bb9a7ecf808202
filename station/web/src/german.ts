// Every German text of the page. The type makes it complete: `npm run check` fails where one is missing.
import type { Lane, Proportion, Result, Signature, Title } from './types';
import { axisOf, faceName, type Strings } from './english';

const decimal = (value: number, places: number) => value.toFixed(places).replace('.', ',');

const verdicts: Record<string, string> = {
  pass: 'Bestanden', conditional_pass: 'Bedingt bestanden', conditional_fail: 'Bedingt nicht bestanden', fail: 'Nicht bestanden',
  inconclusive: 'Kein Urteil', stopped: 'Angehalten', refused: 'Hilft hier nicht',
};
const pane = (r: Result): { word: string; act: string } => {
  switch (r.verdict) {
    case 'pass':
    case 'conditional_pass': {
      const word = `${r.verdict === 'pass' ? 'BESTANDEN' : 'BEDINGT BESTANDEN'} - ${r.written ? 'GESCHRIEBEN' : 'NICHT GESCHRIEBEN'}`;
      return { word, act: r.written ? 'Herausnehmen. Nächstes Gerät.' : 'Das Gerät hat noch seine alten Konstanten.' };
    }
    case 'conditional_fail':
    case 'fail': return {
      word: r.verdict === 'fail' ? 'NICHT BESTANDEN' : 'BEDINGT NICHT BESTANDEN',
      act: `${r.written ? 'Die Konstanten wurden in das Gerät geschrieben. ' : ''}In die rote Schale legen.`,
    };
    case 'inconclusive':
    case 'stopped': {
      const word = r.verdict === 'stopped' ? 'ANGEHALTEN' : 'KEIN URTEIL';
      if (r.written) {
        return { word: `${word} - GESCHRIEBEN, NICHT GEPRÜFT`, act: 'Das Gerät hat jetzt die neuen Konstanten, und sie wurden nicht geprüft. Noch einmal messen und schreiben.' };
      }
      if (r.write_begun) {
        return { word: `${word} - VIELLEICHT GESCHRIEBEN`, act: 'Das Gerät hat seine alten Konstanten oder die neuen: Niemand weiß, welche. Noch einmal messen und schreiben.' };
      }
      return { word, act: r.verdict === 'stopped' ? 'Die Messung kam nicht zum Ende.' : r.next_actions?.length ? 'Tun, was unten steht, dann noch einmal messen.' : 'Der Grund steht unten.' };
    }
    default: return { word: 'NICHT GEMESSEN', act: 'Der Grund steht unten.' };
  }
};
const donePrompt = (r: Result | null): string => {
  if (r?.kind === 'capture') {
    return r.verdict === 'pass' ? 'Die Kalibrierdatei ist fertig' : r.file ? 'Die Kalibrierdatei ist nicht brauchbar' : 'Es entstand keine Kalibrierdatei';
  }
  switch (r?.verdict) {
    case 'refused': return 'Nicht gemessen: Der Grund steht unten';
    case 'inconclusive': return 'Kein Urteil: Der Grund steht unten';
    case 'stopped': return 'Angehalten: nicht bis zum Ende gemessen';
    default: return 'Dieses Gerät ist fertig';
  }
};

export const DE: Strings = {
  title: 'Sixpoint-Messplatz',
  tabs: { jig: 'Vorrichtung', today: 'Heute', files: 'Meine Dateien', check: 'Kontrollgeräte', statistics: 'Statistik' },
  language: 'Sprache',
  sounds: 'Töne',
  connection: {
    crowded: 'Zu viele Seiten dieses Messplatzes sind offen: Diese ist etwas verspätet und zeigt keine Messwerte. Bitte andere schließen.',
    lost: 'Der Messplatz antwortet nicht. Läuft das Programm noch? Neuer Versuch …',
  },
  entry: {
    title: 'Diesen Browser anmelden',
    text: 'Öffnen Sie die Adresse, die das Programm beim Start ausgab, oder geben Sie den Code an ihrem Ende ein. Ein angemeldeter Browser zeigt einen neuen Code: „Anderen Browser zulassen“.',
    code: 'Code',
    submit: 'Anmelden',
    another: 'Anderen Browser zulassen',
    next: 'Diese Adresse gilt für einen Browser, zehn Minuten lang:',
  },
  operator: 'Ihr Name',
  pin: {
    title: 'Wer arbeitet hier?',
    name: 'Name', pin: 'PIN', submit: 'Beginnen',
    here: (name, role) => `${name} (${role === 'engineer' ? 'Ingenieur' : 'Techniker'})`,
    out: 'Abmelden',
  },
  scan: 'Etikett einlesen',
  scanGo: 'Suchen',
  lanes: 'Plätze',
  follow: 'Den Platz zeigen, der auf mich wartet',
  lane: (n) => `Platz ${n}`,
  traces: 'Messwerte der letzten sechs Sekunden, in g',
  axis: (name, g) => `${name} ${g} g`,

  face: faceName,
  poseText: (pose) => `${axisOf(pose)}-Achse nach ${pose[0] === '+' ? 'oben' : 'unten'}`,
  poseLabel: (pose) => `Das Gerät mit der Seite ${faceName(pose)} nach oben`,
  boxLive: (text) => `So liegt das Gerät: ${text}`,
  wantedTitle: 'Drehen auf',
  nowTitle: 'Es liegt',
  nowFace: (pose, angle) => (angle > 30 ? 'auf keiner seiner Seiten' : `mit ${faceName(pose)} nach oben`),
  nowUnknown: 'noch unbekannt',

  stillness: {
    moving: 'Bewegung. Bitte liegen lassen.',
    settling: 'Kommt zur Ruhe …',
    dwelling: 'Messung: nicht berühren',
    leaving: 'Genommen. Bitte drehen.',
    refused: 'Nicht genommen.',
  },

  prompt(lane: Lane): string {
    switch (lane.state) {
      case 'absent': return 'Gerät anschließen';
      case 'idle': return lane.scan && !lane.scan.matches ? 'Das ist nicht das eingelesene Gerät' : 'Bereit zur Messung';
      case 'resuming': return lane.capture ? 'Gerät anschließen: Seine Aufzeichnung geht weiter' : 'Gerät anschließen: Seine Messung geht weiter';
      case 'unit_away': return 'Das Gerät ist abgezogen: wieder anschließen';
      case 'wrong_unit': return 'Ein anderes Gerät ist angeschlossen';
      case 'capturing': return lane.capture?.side
        ? (lane.capture.placed ? `Liegen lassen: ${faceName(lane.capture.side)} oben` : `Hinlegen: ${faceName(lane.capture.side)} oben`)
        : 'Aufzeichnung';
      case 'done': return donePrompt(lane.result);
      case 'running':
        if (lane.run?.phase === 'writing') return 'Konstanten werden geschrieben: nicht abziehen';
        if (!lane.run?.wanted) return 'In Arbeit …';
        return `${lane.run.phase === 'reseating' ? 'Abheben, wieder auflegen: ' : ''}Seite ${faceName(lane.run.wanted)} nach oben`;
    }
  },
  donePrompt,
  phase: {
    measuring: 'Erste Runde: jede der sechs Seiten',
    verifying: 'Zweite Runde: jede Seite, von einer anderen aus als zuvor',
    reseating: 'Abgehoben und wieder aufgelegt',
    writing: 'Konstanten werden geschrieben',
    rechecking: 'Das Geschriebene wird geprüft',
    finished: 'Vollständig',
  },
  placements: (done, of) => `${done} von ${of} Lagen`,
  done: (done, of) => `${done} von ${of}`,
  elapsed: (elapsed, left) => `${elapsed} vergangen${left ? `, noch etwa ${left}` : ''}`,
  minutes: (s) => `${Math.floor(s / 60)}:${String(Math.floor(s % 60)).padStart(2, '0')} min`,
  rounds: { faces: 'erste Runde', faces_reversed: 'zweite Runde', reseat: 'wieder aufgelegt', recheck: 'nach dem Schreiben' },
  refused: (text, wanted) => `Nicht genommen: ${text}.${wanted ? ` Jetzt: Seite ${faceName(wanted)} nach oben.` : ''}`,
  takenPoses: 'Bisher genommen',

  start: 'Messung beginnen',
  again: 'Dieses Gerät noch einmal messen',
  write: 'Konstanten in das Gerät schreiben',
  undoKey: 'Letzte Lage zurücknehmen (Rücktaste)',
  stop: 'Messung anhalten',
  stopSure: 'Wirklich anhalten? Was gemessen wurde, bleibt gespeichert.',
  stopYes: 'Ja, anhalten',
  stopNo: 'Nein, weiter',
  jigStopped: (why) => `Die Vorrichtung steht: ${why}. Bitte hinsehen: Sitzt das Gerät richtig, und ist keine Hand in der Vorrichtung?`,
  jigFree: 'Die Vorrichtung ist frei: Sie darf wieder drehen',
  held: (who) => `${who || 'Jemand anderes'} arbeitet an diesem Platz.`,
  takeOver: 'Diesen Platz übernehmen',
  scanned: (serial, ok) => (ok ? `Etikett ${serial}: passt` : `Etikett ${serial}: passt nicht zu diesem Gerät`),

  states: {
    absent: 'leer', idle: 'bereit', resuming: 'wartet', running: 'misst', unit_away: 'abgezogen',
    wrong_unit: 'falsches Gerät', capturing: 'zeichnet auf', done: 'fertig',
  },
  verdicts,
  verdict: (r) => (r.kind === 'jig' && r.verdict === 'refused' ? 'Nicht gemessen' : verdicts[r.verdict] ?? r.verdict),
  verdictSigns: {
    pass: '✔', conditional_pass: '✔?', conditional_fail: '✖?', fail: '✖', inconclusive: '?', stopped: '■', refused: '✖',
  },
  pane,
  writeNow: 'Jetzt schreiben',
  writeNowText: 'Schreibt diese Konstanten in das Gerät, liest sie zurück und misst zwei Seiten noch einmal.',
  lastUnit: (r) => `Letztes Gerät: ${r.serial}, ${pane(r).word}`,
  table: {
    title: 'Messwerte und Grenzen',
    quantity: 'Größe', axis: 'Achse', value: 'Wert', limits: 'Grenzen', uncertainty: (k) => `U (k = ${String(k).replace('.', ',')})`, margin: 'Abstand',
    limit: (low, high) => (low && high ? `${low} bis ${high}` : low ? `ab ${low}` : high ? `bis ${high}` : 'keine'),
  },
  residual: (after, before) =>
    `Fehler der neuen Konstanten bei Messwerten, aus denen sie nicht bestimmt wurden: ${decimal(after, 1)} mg${before === null ? '' : ` (der vorgefundenen: ${decimal(before, 0)} mg)`}`,
  stored: (r) => (r.stored ? `Gespeichert als Messung ${(r.run ?? '').slice(0, 12)}`
    : r.kept_here ? `Hier aufbewahrt als Messung ${(r.run ?? '').slice(0, 12)}; sie wird gesendet, sobald der Speicher antwortet` : r.problem ?? 'Wird gespeichert …'),
  todo: 'Was zu tun ist',
  documents: { certificate: 'Kalibrierschein (PDF)', json: 'Kalibrierschein (JSON)', dcc: 'Kalibrierschein (DCC)', label: 'Etikett (ZPL)', report: 'Bericht (JSON)', save: 'PDF speichern' },
  label: {
    waiting: (why: string) => `Etikett: wartet auf den Drucker${why ? ` (${why})` : ''}`,
    printed: (_why: string) => 'Etikett: gedruckt',
    unconfirmed: (_why: string) => 'Etikett: gesendet; der Drucker hat es nicht bestätigt. Dort nachsehen; fehlt es, noch einmal drucken.',
    print: 'Etikett drucken', again: 'Etikett noch einmal drucken',
  },
  unit: (serial, firmware) => `${serial}, Firmware ${firmware}`,

  today: {
    title: 'Heutige Messungen dieses Messplatzes',
    search: 'Seriennummer, oder ein Etikett einlesen',
    found: (serial) => `Alle Messungen von ${serial}`,
    none: 'Noch keine Messung.',
    list: 'Liste der Messungen',
    units: (n, passed) => `${n} ${n === 1 ? 'Gerät' : 'Geräte'} heute, ${passed} bestanden`,
    table: { time: 'Zeit', serial: 'Gerät', verdict: 'Urteil', operator: 'Wer', papers: 'Papiere' },
  },
  jigDue: (date, over, signedBy) => (!over ? `Kalibrierung der Vorrichtung fällig am ${date}`
    : signedBy ? `Die Kalibrierung der Vorrichtung war am ${date} fällig: ${signedBy} hat unterschrieben, dass sie trotzdem benutzt wird`
      : `Die Kalibrierung der Vorrichtung war am ${date} fällig: Gemessen wird erst, wenn sie kalibriert ist oder ein Ingenieur unterschreibt (--jig-exception)`),
  lock: {
    title: 'Messplatz gesperrt',
    text: 'Ein Kontrollgerät ist außer Kontrolle. Bis ein Ingenieur unterschreibt, werden hier nur Kontrollgeräte gemessen.',
    knownBad: (unit, codes) => `In jeder Schicht muss ${unit} mit ${codes.join(', ')} durchfallen.`,
    next: (units) => `Bitte ein Kontrollgerät noch einmal messen (${units.join(', ')}) und seine Karten ansehen.`,
    sign: 'Als Ingenieur unterschreiben',
    signTitle: 'Unterschrift des Ingenieurs',
    name: 'Name des Ingenieurs',
    reason: 'Was gefunden und getan wurde',
    newBaseline: 'Die Vorrichtung wurde geändert: neue Karten beginnen',
    submit: 'Unterschreiben: Der Messplatz darf weiterarbeiten',
    cancel: 'Jetzt nicht',
    prompt: 'Messplatz gesperrt: nur Kontrollgeräte',
    checkUnit: 'Kontrollgerät',
    problem: (text) => `Die Kontrollgeräte können jetzt nicht abgefragt werden: ${text}`,
  },
  check: {
    title: 'Kontrollgeräte dieses Messplatzes',
    text: (runs) => `Ein Kontrollgerät bleibt am Messplatz und wird wie jedes andere gemessen. Nach ${runs} Messungen gelten seine Karten: Von da an sperrt ein Punkt außer Kontrolle den Messplatz.`,
    open: 'Unter Kontrolle: Der Messplatz ist offen',
    none: 'Dieser Messplatz hat noch kein Kontrollgerät.',
    noRuns: 'An diesem Messplatz wurde noch kein Kontrollgerät gemessen.',
    signed: (s: Signature) => `Letzte Unterschrift: ${s.operator}, ${s.made_at.slice(0, 16).replace('T', ' ')}: ${s.reason}${s.new_baseline ? ' (Karten neu begonnen)' : ''}`,
    change: 'Ein Kontrollgerät hinzufügen oder entfernen',
    serial: 'Seriennummer',
    name: 'Wer entscheidet',
    reason: 'Warum',
    add: 'Das ist ein Kontrollgerät',
    remove: 'Das ist kein Kontrollgerät mehr',
    done: 'Aufgezeichnet.',
    chart: (title, serial) => `${title}: Kontrollgerät ${serial}`,
    label: (title, serial, points, last, limits, signals) =>
      `${title} des Kontrollgeräts ${serial}: ${points} Punkte, der letzte ${last}${limits}${signals ? `, ${signals} Signale` : ''}`,
    within: (low, high) => `, Grenzen ${low} und ${high}`,
    tooFew: (points, runs) => `${points} von ${runs} Messungen, bis Grenzen berechnet werden können`,
    inControl: 'unter Kontrolle',
    outOfControl: 'außer Kontrolle',
    shown: 'gezeigt, sperrt nicht',
    locks: 'sperrt den Messplatz',
    signal: (point, time, rule, meaning) => `Punkt ${point} (${time.slice(0, 16).replace('T', ' ')}), Regel ${rule}: ${meaning}`,
    charts: 'Regelkarten',
    upper: '+3σ', lower: '−3σ', mean: 'Mittel', range: 'gleitende Spannweite', rangeLimit: 'Grenze', baseline: 'Vorlauf',
    legend: 'Ein Quadrat mit einer Zahl: Der Punkt verletzt die von Nelsons Regeln, die diese Zahl hat.',
  },
  statistics: {
    title: 'Statistik',
    by: 'Vergleichen nach',
    groups: { '': 'nichts', station: 'Messplatz', jig: 'Vorrichtung', operator: 'Person', firmware: 'Firmware' },
    from: 'Von', to: 'Vor',
    refresh: 'Neu berechnen',
    none: 'Noch wurde keine Messung gespeichert.',
    all: 'alle', notStated: 'nicht angegeben',
    yield: 'Ausbeute', first: 'Ausbeute im ersten Durchgang', perUnit: 'Zeit je Gerät', runs: 'Messungen', units: 'Geräte',
    percent: (p: Proportion) => (p.value === null ? '–' : `${decimal(100 * p.value, 1)} %`),
    interval: (p: Proportion) => (p.value === null ? '' : `${p.count} von ${p.of}; ${decimal(100 * p.interval[0], 0)} bis ${decimal(100 * p.interval[1], 0)} %`),
    intervals: 'Kleine Zahlen: Anzahlen und das 95-%-Intervall. Zeit: Median aller Messungen eines Geräts zusammen.',
    seconds: (s) => (s === null ? '–' : s < 120 ? `${decimal(s, 0)} s` : `${decimal(s / 60, 1)} min`),
    codes: 'Warum Geräte nicht bestanden',
    noCodes: 'Jede Messung bestand.',
    code: 'Fehlercode', times: 'Messungen', next: 'Was zu tun ist',
    capability: 'Prozessfähigkeit',
    quantity: 'Größe', n: 'Geräte', meanOf: 'Mittel', sd: 'Standardabweichung', cp: 'Cp', cpk: 'Cpk (95-%-Intervall)',
    noCapability: 'Zu wenige Geräte für die Prozessfähigkeit.',
    limitsDiffer: (names) => `Kein Cpk, denn Geräte wurden nach verschiedenen Grenzen beurteilt: ${names.join('; ')}.`,
    quantityTitle: (t: Title) => `${t.title}${t.axis ? ` ${t.axis}` : ''}${t.unit ? `, ${t.unit}` : ''}`,
    gage: 'Messsystemanalyse (R&R)',
    gageNone: 'Der Speicher hat keine Messsystemanalyse. Eine messen: sixpoint jig --study NAME --operator WER',
    study: 'Studie', axis: 'Achse', compute: 'Berechnen',
    gageUsable: 'Das Messsystem ist brauchbar', gageBad: 'Das Messsystem ist nicht brauchbar',
    gageText: (grr, ndc, judgement) => `${decimal(grr, 1)} % der Gesamtstreuung, ${ndc} unterscheidbare Klassen: ${judgement}`,
    gageOf: (parts, operators, trials) => `${parts} Teile, ${operators} Personen, ${trials} Wiederholungen`,
    source: 'Quelle', share: 'Anteil an der Varianz, %', studyShare: '% der Gesamtstreuung',
    sources: {
      grr: 'R&R des Messsystems', repeatability: 'Wiederholbarkeit', reproducibility: 'Vergleichbarkeit', operator: 'Person',
      'part x operator': 'Teil × Person', part: 'Von Teil zu Teil', total: 'Gesamt',
    },
  },

  problemLog: (text) => `Störung: ${text}`,
  hand: {
    title: 'Übung: Dieses Gerät ist virtuell. Hier wird es gedreht.',
    tilt: 'nächste um 7,2° gekippt', lean: 'Auf eine Kante lehnen', knock: 'Anstoßen', unplug: 'Abziehen', plug: 'Anschließen', swap: 'Gegen ein anderes tauschen',
  },

  files: {
    captureTitle: '1. Eine Kalibrierdatei aufzeichnen',
    captureText: 'Schließen Sie Ihr Gerät an. Es zeichnet auf, während es nacheinander auf jeder seiner sechs Seiten liegt, auf einem Tisch, der sich nicht bewegt. Das dauert etwa fünf Minuten. Die Datei wird geprüft, die Konstanten werden gespeichert.',
    captureLane: 'Gerät',
    captureStart: 'Aufzeichnung beginnen',
    captureNone: 'Kein Gerät ist angeschlossen.',
    captureStop: 'Aufzeichnung anhalten',
    kept: 'Was aufgezeichnet ist, bleibt; die unterbrochene Seite wird noch einmal verlangt.',
    placed: 'Es liegt so',
    sideOf: (n, of) => `Seite ${n} von ${of}`,
    rest: (s) => `${s} s lang nicht berühren`,
    next: 'Das Gerät wird gedreht …',
    checkTitle: '2. Oder eine vorhandene Datei prüfen',
    checkText: 'Eine Kalibrierdatei, die ohne dieses Programm aufgezeichnet wurde: Ist jede Seite darin?',
    check: 'Prüfen',
    save: 'Ihre Konstanten speichern',
    saved: (file) => file ? `Konstanten gespeichert in ${file} und im Speicher.` : 'Konstanten gespeichert im Speicher.',
    usable: 'Diese Datei ist brauchbar: Jede Seite ist darin.',
    notUsable: 'Diese Datei ist noch nicht brauchbar.',
    again: (sides) => `Das Gerät lag nicht lange genug still auf ${sides.map(faceName).join(', ')}: Es hat sich bewegt oder lag auf einer anderen Seite. Nur ${sides.length === 1 ? 'diese Seite wird' : 'diese Seiten werden'} noch einmal verlangt; die anderen bleiben.`,
    repeat: (sides) => `${sides.length === 1 ? 'Diese Seite' : 'Diese Seiten'} wiederholen: ${sides.join(', ')}`,
    sideOk: 'aufgezeichnet', sideMissing: 'wiederholen',
    cannotHelp: 'Eine Aufzeichnung dieses Geräts kann nicht helfen.',
    repairTitle: '3. Meine Dateien reparieren',
    repairText: 'Jede betroffene Aufzeichnung des Ordners wird in einen anderen Ordner repariert. Ihre Originale bleiben, wie sie sind.',
    folder: 'Ordner mit Aufzeichnungen',
    thisFolder: 'dieser Ordner',
    output: 'Ordner für reparierte Dateien',
    repair: 'Meine Dateien reparieren',
    cancel: 'Nach dieser Datei anhalten',
    progress: (done, total) => `${done} von ${total} Dateien`,
    status: {
      repaired: 'repariert', not_affected: 'nicht betroffen', not_repairable: 'noch nicht reparierbar',
      already_repaired: 'schon repariert', outdated: 'veraltet', failed: 'fehlgeschlagen',
    },
    jobStates: { running: 'In Arbeit …', done: 'Fertig.', cancelled: 'Angehalten.', failed: 'Es ist nicht gelungen.' },
    table: { file: 'Datei', status: 'Ergebnis', before: 'Fehler vorher, mg', after: 'nachher, mg', why: 'Warum' },
    none: 'Hier sind keine .gt3x-Dateien.',
    file: 'Datei',
  },
};
