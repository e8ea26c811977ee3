"""The report: one HTML page that holds everything it shows, in light and in dark."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from app.evaluate import plots, words
from app.evaluate.circumstances import Circumstances
from app.evaluate.gauge import gauge, key
from app.evaluate.runs import EvaluationError, Run
from pipeline.lab.evaluate import Figure, Row

CHIPS = {
    "reproduced": ("good", "✓"),
    "beaten": ("best", "▲"),
    "not reproduced": ("bad", "✕"),
    "no figure in the paper": ("", "–"),
    "met": ("good", "✓"),
    "NOT MET": ("bad", "✕"),
}


def page(name: str, runs: Sequence[Run], left_out: Sequence[str], about: Circumstances) -> str:
    """The page of one call of the command. left_out: what was not run and why. Raises EvaluationError."""
    single = runs[0] if len(runs) == 1 else None
    title = single.experiment.title if single else "The papers' claims, measured"
    return "".join(
        (
            '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n',
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n',
            f"<title>{escape(name)}: {escape(title)}</title>\n",
            f"<style>\n{(Path(__file__).parent / 'report.css').read_text(encoding='utf-8')}</style>\n</head>\n<body>\n",
            '<div class="page">\n<header>\n',
            f'<p class="kicker">Airside evaluation · {about.date:%-d %B %Y}</p>\n<h1>{escape(title)}</h1>\n',
            f'<p class="source">{escape(single.name)} · {escape(single.experiment.source)}</p>\n' if single else "",
            "</header>\n<main>\n",
            _single(single) if single else _several(runs, left_out),
            "</main>\n",
            _about(runs, about),
            "</div>\n</body>\n</html>\n",
        )
    )


def _single(run: Run) -> str:
    return _tiles(run.rows) + _body(run)


def _several(runs: Sequence[Run], left_out: Sequence[str]) -> str:
    head = ("experiment", "rows", "reproduced", "beaten", "not reproduced", "met", "NOT MET", "trials", "time")
    lines = []
    for run in runs:
        found = words.count(run.rows)
        counts = (
            found.rows,
            found.reproduced,
            found.beaten,
            found.not_reproduced,
            found.met,
            found.not_met,
            run.trials,
        )
        cells = "".join(f'<td class="n">{number or "–"}</td>' for number in counts)
        link = f'<a href="#{escape(run.name)}">{escape(run.name)}</a>'
        lines.append(f'<tr><th scope="row">{link}</th>{cells}<td class="n">{words.duration(run.seconds)}</td></tr>\n')
    left = "".join(f"<li>{escape(line)}</li>" for line in left_out)
    return "".join(
        (
            _tiles([row for run in runs for row in run.rows]),
            _table([(one, "n" if k else "") for k, one in enumerate(head)], lines, "Summary"),
            f'<ul class="left-out">{left}</ul>\n' if left else "",
            *(
                f'<section class="run" id="{escape(run.name)}">\n<p class="kicker">{escape(run.name)}</p>\n'
                f'<h2>{escape(run.experiment.title)}</h2>\n<p class="source">{escape(run.experiment.source)}</p>\n'
                f"{_body(run)}</section>\n"
                for run in runs
            ),
        )
    )


def _body(run: Run) -> str:
    first, others = words.parted(run.rows)
    facts = {"trials": run.trials, "seed": run.seed, "took": words.duration(run.seconds)}
    facts |= words.settings_of(run.experiment)
    listed = "".join(f"<dt>{escape(k)}</dt><dd>{escape(words.said(v))}</dd>" for k, v in facts.items())
    said = f"{'the short version, ' if run.quick else ''}{run.trials} trials, seed {run.seed}"
    more = f"{len(others)} more rows, with nothing to compare with"
    return "".join(
        (
            f'<p class="reading"><b>Reading</b>{escape(run.experiment.reading)}</p>\n',
            _results(first, f"Results of {run.name}"),
            f"<details><summary>{more}</summary>\n{_results(others, more, long=True)}</details>\n" if others else "",
            _figures(run),
            f"<details><summary>Settings: {said}</summary>\n<dl>{listed}</dl></details>\n",
        )
    )


def _results(rows: Sequence[Row], label: str, long: bool = False) -> str:
    asked = any(row.wanted is not None for row in rows)
    compared = asked or any(row.paper is not None for row in rows)
    head = [("", ""), ("paper", "n"), ("ours", "n"), ("95 % interval", ""), ("unit", "")]
    head += [("ours beside it", "")] if compared else []
    head += [("verdict", "")]
    head += [("wanted", "")] if asked else []
    body = [_row(row, asked, compared) for row in rows]
    return _table(head, body, label, long) + (key(asked) if compared else "")


def _row(row: Row, asked: bool, compared: bool) -> str:
    cells = [
        f'<th scope="row">{escape(row.name)}</th>',
        f'<td class="n">{words.figure(row.paper)}</td>',
        f'<td class="n ours">{words.figure(row.measured)}</td>',
        f'<td class="interval">{words.interval(row)}</td>',
        f'<td class="unit">{escape(row.unit)}</td>',
    ]
    if compared:
        cells.append(f'<td class="gauge">{gauge(row)}</td>')
    cells.append(f"<td>{_chip(row.verdict)}</td>")
    if asked:
        cells.append(f'<td class="wanted">{words.wanted(row)} {_chip(words.met(row))}</td>')
    return f"<tr>{''.join(cells)}</tr>\n"


def _chip(word: str) -> str:
    if not word:
        return ""
    kind, sign = CHIPS[word]
    return f'<span class="chip {kind}">{sign} {word}</span>'


def _table(head: Sequence[tuple[str, str]], body: Iterable[str], label: str, long: bool = False) -> str:
    cells = "".join(f'<th scope="col" class="{kind}">{escape(one)}</th>' for one, kind in head)
    return (
        f'<div class="scroll{" long" if long else ""}" tabindex="0" role="region" aria-label="{escape(label)}">\n'
        f"<table>\n<thead><tr>{cells}</tr></thead>\n<tbody>\n{''.join(body)}</tbody>\n</table>\n</div>\n"
    )


def _tiles(rows: Sequence[Row]) -> str:
    found = words.count(rows)
    tiles = [
        ("good", found.reproduced, "reproduced"),
        ("best", found.beaten, "beaten"),
        ("bad", found.not_reproduced, "not reproduced"),
        ("", found.no_figure, "without a figure in the paper"),
    ]
    if found.met + found.not_met:
        tiles += [("good", found.met, "wanted bounds met"), ("bad", found.not_met, "wanted bounds NOT MET")]
    listed = "".join(
        f'<li class="{kind if number else "zero"}"><b>{number}</b><span>{what}</span></li>'
        for kind, number, what in tiles
    )
    return f'<ul class="tiles">{listed}</ul>\n'


def _figures(run: Run) -> str:
    try:
        made = run.figures()
    except EvaluationError as error:
        return f'<p class="left-out">{escape(str(error))}</p>\n'
    return "".join(_figure(figure, f"{run.name}-{k}") for k, figure in enumerate(made))


def _figure(figure: Figure, salt: str) -> str:
    legend = ""
    if figure.lines and not figure.pictures:
        entries = zip(figure.lines, plots.looks(figure.lines), strict=True)
        legend = "".join(f"<li>{_swatch(look, line.style)}{escape(line.label)}</li>" for line, look in entries)
        legend = f'<ul class="legend">{legend}</ul>\n'
    note = f"<figcaption>{escape(figure.note)}</figcaption>\n" if figure.note else ""
    return (
        f"<figure>\n<h3>{escape(figure.title)}</h3>\n{legend}"
        f'<div class="plot">{plots.svg(figure, salt)}</div>\n{note}</figure>\n'
    )


def _swatch(look: plots.Look, style: str) -> str:
    dash = f' stroke-dasharray="{" ".join(str(one) for one in look.dash)}"' if look.dash else ""
    line = f'<path d="M1 6H29" stroke="{look.css}" stroke-width="{look.width}"{dash}/>' if style != "points" else ""
    shape = {
        "s": "M11 2h8v8h-8z", "^": "M15 1.5l5 9h-10z", "v": "M15 10.5l5-9h-10z", "D": "M15 1l5 5-5 5-5-5z",
        "P": "M13 1h4v3h3v4h-3v3h-4v-3h-3v-4h3z", "X": "M11 1l4 3 4-3 1 2-3 3 3 3-1 2-4-3-4 3-1-2 3-3-3-3z",
        "*": "M15 0l1.6 4 4.4.3-3.4 2.8 1.1 4.2-3.7-2.3-3.7 2.3 1.1-4.2-3.4-2.8 4.4-.3z",
    }.get(look.marker, "M11 6a4 4 0 1 0 8 0a4 4 0 1 0 -8 0")  # fmt: skip
    fill = "var(--card)" if style == "paper" else look.css
    mark = f'<path d="{shape}" fill="{fill}" stroke="{look.css}"/>' if look.marker and style != "bound" else ""
    return f'<svg viewBox="0 0 30 12" aria-hidden="true" fill="none">{line}{mark}</svg>'


def _about(runs: Sequence[Run], about: Circumstances) -> str:
    lines = [("Command", f"<code>{escape(about.command)}</code>")]
    lines += [(name, escape(value)) for name, value in about.lines()]
    lines.append(("Seed", str(runs[0].seed)))
    lines.append(("Took", words.duration(sum(run.seconds for run in runs))))
    listed = "".join(f"<dt>{name}</dt><dd>{value}</dd>" for name, value in lines)
    return f'<footer class="about">\n<h3>How this was made</h3>\n<dl>{listed}</dl>\n</footer>\n'
