"""Rules of style sheets: which elements selectors meet, and which rule holds."""

import pytest
from svg_programs import small

from strokestyle.svg import style_sheet
from strokestyle.svg.read import read_svg_file
from strokestyle.svg.read_curves import read_curves_svg
from strokestyle.svg.style_sheet import declarations, styles_of, write_out_rules
from strokestyle.svg.write import write_svg

TREE = """<svg xmlns="http://www.w3.org/2000/svg" id="r"><style>{}</style>
<g id="a" class="k l" lang="en-GB"><path id="a1" d="M0 0"/><path id="a2" class="l"/>
<rect id="a3" x=""/></g><g id="b"><g id="c"><path id="c1"/></g><text id="t">a</text>
<path id="b1" class="m"/></g></svg>"""
MET = {  # by selector, the ids of all that it means
    "path": "a1 a2 c1 b1",
    "*": "r a a1 a2 a3 b c c1 t b1",
    "*|path, g.l , #t": "a t",  # the first of these is not understood
    "g path": "a1 a2 c1 b1",
    "g > path": "a1 a2 c1 b1",
    "g>g>path": "c1",
    "g g path": "c1",
    "svg > path": "",
    "g + g": "b",
    "path + path": "a2",
    "path+rect": "a3",
    "path ~ rect": "a3",
    "g ~ path": "b1",
    "#a ~ g path": "c1 b1",
    "#c + text + .m": "b1",
    "rect ~ path": "",
    "path~path~rect": "a3",
    "[id=a1]": "a1",
    "[id='a1'], [id = \"b1\" ]": "a1 b1",
    "[x]": "a3",
    "[x='']": "a3",
    "[class~=l]": "a a2",
    "[class='l']": "a2",
    "[id^=a]": "a a1 a2 a3",
    "[id^='']": "",
    "[id$='1']": "a1 c1 b1",
    "[class*='k l']": "a",
    "[lang|=en]": "a",
    "[lang|='en-']": "",
    "[id=A1]": "",
    "[id=A1 i]": "a1",
    "path.l[id]": "a2",
    ":root": "r",
    "path:first-child": "a1 c1",
    "path:last-child": "c1 b1",
    "g > :nth-child(2)": "a2 t",
    "g > :nth-child(odd)": "a1 a3 c c1 b1",
    "g > :nth-child(2n + 1)": "a1 a3 c c1 b1",
    "g > :nth-child(-n+2)": "a1 a2 c c1 t",
    "g > :nth-child( 2n )": "a2 t",
    "g > :nth-child(n+3)": "a3 b1",
    "g > :nth-last-child(1)": "a3 c1 b1",
    "path:nth-of-type(2)": "a2",
    "path:only-child": "c1",
    "g > path:only-of-type": "c1 b1",
    "path:last-of-type": "a2 c1 b1",
    "path:not(.l)": "a1 c1 b1",
    "path:not(.l, #c1)": "a1 b1",
    "#a > :not(path)": "a3",
    ":is(#a,#b) > path:where(:not(:first-child))": "a2 b1",
    "path:hover, text::before, path:not(:hover)": "a1 a2 c1 b1",
}


def met(selector, declared="fill:red"):
    sheet = (selector + "{" + declared + "}").replace(">", "&gt;")
    styles = styles_of(TREE.format(sheet).encode())
    ids = "r style a a1 a2 a3 b c c1 t b1".split()
    assert all(rules.usual == declarations(declared).usual for rules in styles.of.values())
    return [ids[i] for i in sorted(styles.of) if i != 1], styles.unread


@pytest.mark.parametrize("selector", MET)
def test_selectors_meet_what_they_mean(selector):
    ids, unread = met(selector)
    assert ids == MET[selector].split()
    assert unread == (("*|path",) if "|path" in selector else ())


@pytest.mark.parametrize(
    "selector",
    [
        "g:has(path)", "path:nth-child(2n+)", "path:nth-child(2 of .l)", "path:not(g path)", "[id",
        "path:lang(en)", "svg|path", "g || path", "a\\:b", "> path", "g >", "path:not()", ".",
        "path:first-child()", "path:nth-child", "g[id]path", "g > > path", "x" * 2_000,
        " ".join("g" * 40),
    ],
)  # fmt: skip
def test_what_is_not_understood_is_told_and_meets_nothing(selector):
    ids, unread = met(selector)
    assert ids == [] and unread == (selector,)
    assert met(selector, "font-size:9px")[1] == ()  # nor does it matter


@pytest.mark.parametrize(
    "sheet, fill",
    [  # for path#a2.l in g#a
        (".l{fill:red}path{fill:blue}", "red"),
        ("path{fill:red}path{fill:blue}", "blue"),
        ("#a2{fill:red}g.k.l path.l.l[id]:nth-child(2){fill:blue}", "red"),
        ("path[id]{fill:red}.l{fill:blue}", "red"),
        ("path:first-of-type + path{fill:red}path.l{fill:blue}", "red"),
        (":where(#a2){fill:red}path{fill:blue}", "blue"),
        (":is(#a2,g){fill:red}path.l{fill:blue}", "red"),
        ("path:not(#x){fill:red}path.l{fill:blue}", "red"),
        ("path{fill:red!important}#a2{fill:blue}", "red"),
        ("path{fill:red ! important}#a2{fill:blue !important}", "blue"),
        ("@media print{path{fill:red}}", None),
        ("@media screen{path{fill:red} .m{fill:blue}}", "red"),
        ("@font-face{src:url(x)}path{fill:red}", "red"),
        ("path{fill:red} /* } */ .m{fill:blue", "red"),
        ("path{fill:red}/* path{fill:blue}", "red"),
        ("<!-- path{fill:red} -->", "red"),
        ("path{;fill : RED;;stroke}", "red"),
    ],
)
def test_the_heaviest_rule_holds_and_of_two_as_heavy_the_later(sheet, fill):
    sheet = sheet.replace("<", "&lt;").replace(">", "&gt;")
    styles = styles_of(TREE.format(sheet).encode())
    rules = styles.of.get(4)
    got = None if rules is None else declarations("").over(rules).get("fill")
    assert got == fill and styles.unread == ()


def test_an_elements_own_style_is_over_rules_but_important_ones():
    rules = declarations("fill:red;stroke:red!important;opacity:1!important")
    own = declarations("fill:blue;stroke:blue;opacity:0!important")
    assert own.over(rules) == {"fill": "blue", "stroke": "red", "opacity": "0"}


def test_other_rules_for_shapes_are_told():
    sheet = '@import "x.css";@supports (x:y){path{fill:red}}@media (width>9px){a{fill:red}}'
    assert styles_of(TREE.format(sheet).encode()).unread == (
        '@import "x.css"', "@supports (x:y)", "@media (width>9px)",
    )  # fmt: skip
    text = write_svg(small("grain")).replace("<g ", "<style>g:has(a){fill:red}</style><g ", 1)
    assert read_svg_file(text).unread_rules == ("g:has(a)",)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "iso-8859-1"])
def test_rules_are_written_where_they_hold(encoding):
    sheet = "path{fill:red;stroke:blue}#a2{opacity:.5!important;clip-path:url(#\u00c9)}"
    text = TREE.format(sheet).replace('id="a2"', "id=\"a2\" style='opacity:1;mask:none'")
    text = f"<?xml version='1.0' encoding='{encoding}'?>{text}"
    made = write_out_rules(text.encode(encoding))[0]
    made = made.decode("utf-8" if encoding == "utf-16" else encoding)
    assert '<path style="fill:red" id="a1"' in made
    want = 'style="fill:red;clip-path:url(#&#201;);opacity:1;mask:none;opacity:.5"'
    assert f'<path id="a2" {want} class="l"/>' in made
    assert write_out_rules(TREE.format("path{stroke:red}").encode())[0].count(b"style=") == 0


def test_a_file_in_utf_16_is_read_with_its_rules_and_clones():
    text = write_svg(small("grain"))
    text = text.replace("<g ", "<style>#s003{opacity:.5}</style><g ", 1)
    text = text.replace("</svg>", '<use href="#s003" class="Ä"/></svg>')
    head = text.replace('encoding="utf-8"', 'encoding="utf-16"')
    want, got = read_svg_file(text), read_svg_file(head.encode("utf-16"))
    assert len(got.ids) == 6 and got.ids == want.ids
    assert (got.drawing.color == want.drawing.color).all()
    assert got.drawing.color[5, 3] < 0.6 < got.drawing.color[4, 3]


def test_a_clone_has_the_rules_of_what_it_draws_where_that_stands():
    sheet = "#layer-contour > .stroke{transform:translate(0,5px)} .b .stroke{opacity:0}"
    sheet = f"<style>{sheet}</style>"
    text = write_svg(small(None)).replace("<g ", sheet + "<g ", 1)
    text = text.replace("</svg>", '<g class="b"><use href="#s003" x="9"/></g></svg>')
    file, curves = read_svg_file(text), read_curves_svg(text.encode(), (120, 100), 0.1)
    strokes = file.drawing.strokes
    i = file.ids.index("s003")
    at = [strokes.xy[strokes.rows(k)] for k in (i, 5)]
    assert at[1] == pytest.approx(at[0] + [9, 0], abs=0.02)
    plain = read_svg_file(text.replace("5px", "0px")).drawing.strokes
    assert at[0] == pytest.approx(plain.xy[plain.rows(i)] + [0, 5], abs=0.02)
    assert file.drawing.color[5, 3] == file.drawing.color[i, 3] > 0 and len(curves) == 6


@pytest.mark.parametrize(
    "sheet",
    [
        "g " * 29 + "g{fill:red}",
        "g ~ " * 20 + "g{fill:red}",
        "@" * 300_000, "/*" * 300_000, "a" * 900_000, "{" * 500_000, "[" * 500_000 + "{fill:red}",
        "a{b" * 200_000, "(" * 900 + "{fill:red}", ":not(" * 190 + "{fill:red}",
        "'" * 300_001 + "{fill:red}", "@media screen{" * 60_000,
    ],
    ids=range(12),
)  # fmt: skip
def test_hostile_sheets_are_read_once(sheet, monkeypatch):
    """Trying all ancestors of each element for each part would take years."""
    depth = 200
    monkeypatch.setattr(style_sheet, "MAX_LOOKS", 31 * 3 * depth)
    text = '<svg xmlns="http://www.w3.org/2000/svg"><style>{}</style>{}{}</svg>'
    styles_of(text.format(sheet, "<g><g/><g/>" * depth, "</g>" * depth).encode())


def test_sheets_that_take_too_long_are_refused(monkeypatch):
    monkeypatch.setattr(style_sheet, "MAX_LOOKS", 15)
    with pytest.raises(ValueError, match="its style sheets are too intricate: simplify it first"):
        met("path,g,*,g > path")
    monkeypatch.setattr(style_sheet, "MAX_RULES", 3)
    assert met("x,path,y,g")[1] == ("g",)
