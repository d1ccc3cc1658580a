"""Formulas as MathML, made when the site is built: no script, no font, nothing to load."""

import re

from docutils import nodes
from latex2mathml.converter import convert

# Browsers know no `mathvariant` but "normal": bold letters are letters of their own.
STYLED = re.compile(r'<mi mathvariant="(bold|bold-italic|sans-serif)">(.)</mi>')
FIRST = {"bold": (0x1D400, 0x1D41A, 0x1D6C2), "bold-italic": (0x1D468, 0x1D482, 0x1D736), "sans-serif": (0x1D5A0, 0x1D5BA, 0x1D6C2)}


def styled(found):
    """The letter of mathematical alphabets that looks like this."""
    letter, (upper, lower, greek) = found[2], FIRST[found[1]]
    for start, end, first in (("A", "Z", upper), ("a", "z", lower), ("α", "ω", greek)):
        if start <= letter <= end:
            return f"<mi>{chr(first + ord(letter) - ord(start))}</mi>"
    return f"<mi>{letter}</mi>"


def mathml(node, display):
    """MathML of a formula; commands that the converter does not know are an error."""
    made = convert(node.astext(), display=display)
    if "\\" in made:
        raise ValueError(f"not understood: {node.astext()}")
    return STYLED.sub(styled, re.sub(r"&#x([0-9A-Fa-f]+);", lambda found: kept(int(found[1], 16)), made))


def kept(code):
    """A character, but for those that mean something in HTML."""
    return f"&#{code};" if chr(code) in "<>&" else chr(code)


def inline(self, node):
    self.body.append(mathml(node, "inline"))
    raise nodes.SkipNode


def block(self, node):
    self.body.append(f'<div class="formula">{mathml(node, "block")}</div>\n')
    raise nodes.SkipNode


def setup(app):
    app.add_html_math_renderer("mathml", inline_renderers=(inline, None), block_renderers=(block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
