"""``slideviz report``: one HTML file, complete and by itself."""

import re
from base64 import b64decode
from html.parser import HTMLParser
from io import BytesIO

import pytest
from PIL import Image

from slideviz.cli import run
from slideviz.samples.table import write_sample


class Reader(HTMLParser):
    """Reads a report: rows of its tables by heading, pictures, and the tags."""

    def __init__(self):
        super().__init__()
        self.tables, self.pictures, self.tags, self.sentences = {}, [], set(), []
        self.heading = self.inside = ""

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.inside = tag
        if tag == "img":
            self.pictures.append(dict(attrs)["src"])
        elif tag == "tr":
            self.tables[self.heading].append([])
        elif tag in ("td", "th"):
            self.tables[self.heading][-1].append("")

    def handle_data(self, data):
        if self.inside == "h2":
            self.heading = data
            self.tables[data] = []
        elif self.inside == "p" and data.strip():
            self.sentences.append(data)
        elif self.inside in ("td", "th") and data.strip():
            self.tables[self.heading][-1][-1] += data

    def handle_endtag(self, tag):
        self.inside = ""


def read_report(path):
    reader = Reader()
    text = path.read_text("utf-8")
    reader.feed(text)
    assert not re.findall(r"https?:|//|<script|<link|@import|url\(", text.partition("base64")[0])
    assert not reader.tags & {"script", "link", "iframe", "object"}
    for source in reader.pictures:
        head, _, data = source.partition(",")
        assert head == "data:image/png;base64"
        with Image.open(BytesIO(b64decode(data))) as image:
            assert min(image.size) >= 300
    return reader


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_sample("square", tmp_path / "s", size=8)
    return tmp_path


def test_a_report_has_pictures_numbers_limits_case_and_versions(here, capsys):
    name = 'a<b>&"c".cfg'
    (here / "s" / name).write_text((here / "s" / "square.cfg").read_text())
    limits = "LIMITS=( min > 0.3, inverted = 0 )"
    words = ["report", f"s/{name}", "-o", "r.html", "--steps", "2", "--set", limits]
    assert run(words) == 4, "a limit is not met"
    report = read_report(here / "r.html")
    assert len(report.pictures) == 2
    runs = dict(report.tables["Runs"])
    assert runs["method"] == "pseudo sliding"
    assert runs["steps"] == "2"
    assert report.tables["Limits"][0] == ["Limit", "Value", "Result"]
    assert [row[2] for row in report.tables["Limits"][1:]] == ["not met", "met"]
    assert report.tables["Limits"][1][0] == "min > 0.3"
    assert ["STEPS", "2"] in report.tables["Case"]
    assert ["MARKER_MOVING", "( BLOCK )"] in report.tables["Case"]
    assert report.tables["Layers at walls"][0][0] == "Boundary"
    assert any(row[0].startswith("numpy ") for row in report.tables["Versions"])
    assert "<title>a&lt;b&gt;&amp;&quot;c&quot;.cfg</title>" in (here / "r.html").read_text()
    assert list(here.glob("*.su2")) == [], "no mesh is written"


def test_it_can_be_handed_on(here, capsys):
    """With date, units and remarks; no row is empty, every table has a header."""
    run(["report", "s/square.cfg", "-o", "r.html", "--steps", "1", "-q", "--set", "LAYERS=KEEP"])
    report = read_report(here / "r.html")
    date, mesh, done, units = report.sentences
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d \S+", date)
    assert mesh.startswith("mesh.su2: 2D, 60 cells, 80 points, 1 × 1")
    assert done.startswith("Run 1: Done")
    assert "Lengths are in the unit of the mesh, angles in degrees." in units
    assert (here / "r.html").read_text("utf-8").count("<thead>") == len(report.tables)
    for title, rows in report.tables.items():
        assert len(rows) > 1, title
        assert all(len(row) == len(rows[0]) for row in rows), title
        assert all(set(row[1:] or row) - {"–", ""} for row in rows), title
    assert report.tables["Remarks"][0] == ["Run", "Kind", "Remark"]
    assert {row[1] for row in report.tables["Remarks"][1:]} <= {"warning", "note"}
    assert not any("\\" in row[1] for row in report.tables["Case"])


def test_its_name_is_that_of_the_case_and_no_input_is_replaced(here, capsys):
    assert run(["report", "s/square.cfg", "-q", "--steps", "1"]) == 0
    assert "Limits" not in read_report(here / "square_report.html").tables
    assert run(["report", "s/square.cfg", "-o", "s/mesh.su2"]) == 1
    assert "mesh" in capsys.readouterr().err
