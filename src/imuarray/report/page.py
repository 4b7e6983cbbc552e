"""report.html: one file, readable without a network, every text escaped."""

from __future__ import annotations

from jinja2 import Environment, StrictUndefined

STYLE = """
:root { --ink: #1a1a1a; --soft: #5a5a5a; --line: #d8d8d8; --wash: #f5f6f7; --blue: #0072B2;
  --loud: #D55E00; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 56rem; padding: 2rem 1.25rem 4rem; color: var(--ink);
  font: 16px/1.55 system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; background: white; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: 0 0 .25rem; overflow-wrap: anywhere; }
h2 { font-size: 1.2rem; margin: 2.6rem 0 .6rem; padding-bottom: .2rem;
  border-bottom: 1px solid var(--line); }
h3 { font-size: 1.02rem; margin: 1.3rem 0 .3rem; }
p { margin: .4rem 0; }
.facts { color: var(--soft); margin: 0 0 1rem; }
.verdict { border-left: 5px solid var(--blue); background: var(--wash); padding: .7rem 1rem;
  font-size: 1.08rem; font-weight: 600; }
.loud { border: 2px solid var(--loud); border-left-width: 9px; padding: .6rem 1rem;
  font-weight: 600; margin: .8rem 0; }
ol, ul { margin: .4rem 0; padding-left: 1.5rem; }
li { margin: .25rem 0; }
figure { margin: 1.2rem 0 1.8rem; }
figure img { width: 100%; height: auto; display: block; }
figcaption { color: var(--soft); font-size: .88rem; margin-top: .4rem; }
figcaption b { color: var(--ink); }
.table { overflow-x: auto; }
table { border-collapse: collapse; font-size: .86rem; margin: .4rem 0 .8rem; width: 100%; }
th, td { text-align: left; padding: .22rem .6rem .22rem 0; vertical-align: top;
  border-bottom: 1px solid var(--line); font-variant-numeric: tabular-nums; }
th { font-weight: 600; border-bottom: 2px solid var(--soft); }
td.n, th.n { text-align: right; }
td.n { white-space: nowrap; }
tr.out td { font-weight: 600; }
details { margin: .5rem 0; border: 1px solid var(--line); border-radius: 4px;
  padding: .4rem .8rem; }
summary { cursor: pointer; font-weight: 600; }
.foot { color: var(--soft); font-size: .85rem; margin-top: 2.5rem;
  border-top: 1px solid var(--line); padding-top: .6rem; }
@media print { body { max-width: none; padding: 0; font-size: 10pt; }
  figure, tr, .loud, .verdict { break-inside: avoid; } }
"""

TEMPLATE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Diagnosis of {{ recording }}</title>
<style>STYLE</style>
</head>
<body>
{%- macro shown(table) %}
<div class="table"><table>
<thead><tr>{% for head, right in table.columns %}<th{% if right %} class="n"{% endif %}>
{{- head }}</th>{% endfor %}</tr></thead>
<tbody>
{%- for row in table.rows %}
<tr{% if row.strong %} class="out"{% endif %}>{% for cell in row.cells -%}
<td{% if table.columns[loop.index0][1] %} class="n"{% endif %}>{{ cell }}</td>{% endfor %}</tr>
{%- endfor %}
</tbody></table></div>
{%- endmacro %}
<header>
<h1>Diagnosis of {{ recording }}</h1>
<p class="facts">{{ facts }}</p>
<p class="{{ 'loud' if unexplained else 'verdict' }}">{{ verdict }}</p>
</header>
<main>
<section id="answers">
{%- for answer in answers %}
<h2>{{ loop.index }}. {{ answer.question }}</h2>
{%- if answer.loud %}
<p class="loud">{{ answer.loud }}</p>
{%- endif %}
<p>{{ answer.lead }}</p>
{%- if answer.items %}
{%- set list = 'ol' if loop.index == 2 else 'ul' %}
<{{ list }}>
{%- for item in answer.items %}
<li>{{ item }}</li>
{%- endfor %}
</{{ list }}>
{%- endif %}
{%- endfor %}
</section>
<section id="figures">
<h2>Figures</h2>
{%- for figure in figures %}
<figure id="{{ figure.name }}">
<img src="data:image/png;base64,{{ figure.base64 }}" alt="{{ figure.title }}">
<figcaption><b>{{ figure.title }}.</b> {{ figure.caption }} Files: {{ figure.name }}.pdf, .png, .csv
(the numbers).</figcaption>
</figure>
{%- endfor %}
</section>
<section id="tables">
<h2>Tables</h2>
{%- for table in tables %}
{%- if table.folded %}
<details>
<summary>{{ table.title }}</summary>
<p>{{ table.caption }}</p>
{{- shown(table) }}
</details>
{%- else %}
<h3>{{ table.title }}</h3>
<p>{{ table.caption }}</p>
{{- shown(table) }}
{%- endif %}
{%- endfor %}
</section>
</main>
<footer class="foot">
{%- for line in foot %}
<p>{{ line }}</p>
{%- endfor %}
</footer>
</body>
</html>
"""


def render(**parts) -> str:
    """The page; ``parts`` are texts, escaped here, figures (base64) and tables."""
    environment = Environment(undefined=StrictUndefined, autoescape=True)
    return environment.from_string(TEMPLATE.replace("STYLE", STYLE)).render(**parts)
