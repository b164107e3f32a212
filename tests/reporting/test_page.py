import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from pretouch.modes import Event
from pretouch.profiles import profile
from pretouch.reporting.contacts import contact_section
from pretouch.reporting.html import bad, number, percent, table
from pretouch.reporting.measures import force_section, limit_section, measure
from pretouch.reporting.page import page, summary
from pretouch.reporting.record import gather
from pretouch.reporting.setting import parameter_section
from pretouch.sensing.skin import Skin
from pretouch.types import Mode
from tests.reporting import made


class Reader(HTMLParser):
    """Checks that elements are closed in order, and keeps text, tags and what is fetched."""

    VOID = frozenset({"meta", "img", "br"})

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.text, self.sources = [], [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.sources += [value for name, value in attrs if name in ("src", "href")]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def read(recorded):
    reader = Reader(page(measure(recorded, "one.mcap")))
    reader.said = re.sub(r"\s+", " ", " ".join(reader.text))
    return reader


@pytest.fixture(scope="module")
def reader(touched):
    return read(touched)


def test_the_page_fetches_nothing_and_runs_nothing(reader):
    assert "script" not in reader.tags
    assert "link" not in reader.tags
    assert reader.sources
    assert all(source.startswith("data:image/svg+xml;base64,") for source in reader.sources)


def test_everything_that_was_asked_for_is_on_the_page(reader):
    for words in (
        "What ran", "Detected contacts", "True touches (simulation)", "Proximity was not used", "Speed",
        "Modes and quadratic program", "Limits of the arm", "Units, robot and loop", "Largest true force",
        "For orientation, not conformity", "Parameters", "detect.f_base_n", "panda_hand", "1 of 100 samples",
    ):  # fmt: skip
        assert words in reader.said, words
    assert reader.tags.count("figure") == 2


def one_step(model, skin, **changes):
    return made.recorded(model, skin, [made.step(model, units=len(skin), **changes)])


def nothing_but_nan(model, skin):
    nan, n = np.full(3, np.nan), np.full(model.n, np.nan)
    steps = [
        made.step(
            model, stamp=0.01 * i, ee_position=nan, ee_velocity=nan, path_position=nan, force=nan, filtered_force=nan,
            q=n, q_commanded=n, command=n, speed_scale=np.nan, near=[(0, "panda_hand", np.nan, np.nan)],
        )
        for i in range(1500)
    ]  # fmt: skip
    return made.recorded(model, skin, steps)


def holds_only(model, skin):
    causes = Event.OVERRUN, Event.SKIN_SILENT, Event.NO_FORCE
    steps = [
        made.step(model, stamp=0.01 * i, mode=Mode.HOLD, event=causes[i % 3], reason=f"Reason {'abc'[i % 3]}.")
        for i in range(120)
    ]
    return made.recorded(model, skin, steps)


def without_wrench(model, skin):
    steps = [made.step(model, stamp=0.01 * i, force=np.full(3, np.nan)) for i in range(20)]
    given = [made.inputs(model, stamp=s.stamp) for s in steps]
    given = [replace(g, robot=replace(g.robot, wrench=None)) for g in given]
    return made.recorded(model, skin, steps, given=given)


def backwards(model, skin):
    """Time begins anew in the middle of a contact, as after a reset of a simulation."""
    felt = {"mode": Mode.REACT, "contact": made.contact([0.0, 9.0, 0.0], [False, True, False])}
    steps = [made.step(model, stamp=0.01 * (i % 20), **(felt if i == 18 else {})) for i in range(40)]
    truths = [made.truth([s.stamp], [5.0 if i > 15 else 0.0]) for i, s in enumerate(steps)]
    return made.recorded(model, skin, steps, truths=truths)


ODD = {
    "one step": one_step,
    "no unit": lambda model, skin: one_step(model, Skin((), model)),
    "nan": nothing_but_nan,
    "holds": holds_only,
    "no wrench": without_wrench,
    "backwards": backwards,
    "infinite": lambda model, skin: made.recorded(
        model,
        skin,
        [made.step(model, stamp=0.01 * i, force=np.full(3, np.inf), command=np.full(7, np.inf)) for i in range(5)],
    ),
}


@pytest.mark.parametrize("kind", ODD)
def test_odd_recordings_make_a_page(kind, panda_model, paper_skin):
    assert "What ran" in read(ODD[kind](panda_model, paper_skin)).said


def test_of_very_many_touches_those_are_listed_that_were_missed(panda_model, paper_skin):
    steps, truths = [], []
    for i in range(600):
        felt = {"mode": Mode.REACT, "contact": made.contact([0.0, 9.0, 0.0], [False, True, False])}
        steps.append(made.step(panda_model, stamp=float(i), **(felt if i % 2 and i < 500 else {})))
        truths.append(made.truth([i - 0.99, i - 0.01, float(i)], [0.0, 5.0 * (i % 2), 0.0]))
    m = measure(made.recorded(panda_model, paper_skin, steps, truths=truths), "many")
    said = contact_section(m.course, m.contacts)
    assert said.count(">missed<") == 50
    assert "100 more are left out here; all count in the summary" in said


def test_very_many_profiles_are_summed_up(panda_model, paper_skin):
    runs = [made.Run(panda_model, paper_skin, profile(f"paper:detect.f_base_n={8 + i}")) for i in range(40)]
    kept = [made.Kept(i, None, made.step(panda_model, stamp=0.01 * i)) for i in range(40)]
    course = gather(made.Recorded(tuple(runs), kept))
    assert "34 more profiles are left out" in parameter_section(course)


CUT = "The file ends in the middle of a chunk."


@pytest.mark.parametrize(
    ("section", "file", "said"),
    [
        (summary, {"complete": False, "sentence": CUT}, bad(CUT)),
        (lambda m: contact_section(m.course, m.contacts), {}, "True touches are not known"),
        (lambda m: force_section(m.contacts), {}, "understates the peaks of impacts"),
        (lambda m: limit_section(m.course), {}, '<span class="bad">Exceeded: velocity of joint 1'),
    ],
)
def test_what_is_cut_off_not_known_or_exceeded_is_said(panda_model, paper_skin, section, file, said):
    one = replace(one_step(panda_model, paper_skin, command=np.full(7, 9.0)), **file)
    assert said in section(measure(one, "one.mcap"))


def test_text_of_a_file_stays_text(panda_model, paper_skin):
    evil = '<script>alert(1)</script>"><img src=x onerror=alert(1)>$x^{$ & </style>'
    skin = Skin([replace(paper_skin.units[0], id=evil), *paper_skin.units[1:]], panda_model)
    steps = [made.step(panda_model, stamp=0.01 * i, mode=Mode.HOLD, reason=f"{evil} {i}") for i in range(3)]
    run = made.Run(panda_model, skin, replace(profile("paper"), name=evil), versions={evil: evil}, about={evil: [evil]})
    hostile = made.Recorded((run,), [made.Kept(0, None, s) for s in steps], False, evil)
    reader = Reader(page(measure(hostile, evil)))
    assert "script" not in reader.tags
    assert reader.tags.count("img") == 2
    assert any(evil in text for text in reader.text)


def test_parameters_that_are_not_the_papers_are_marked(panda_model, paper_skin):
    changed = one_step(panda_model, paper_skin)
    changed.runs[0].profile = profile("paper:detect.f_base_n=8")
    text = parameter_section(gather(changed))
    assert re.findall(r'<b class="other">(.*?)</b>', text) == ["8"]
    rows = dict(re.findall(r'<td class="w">([^<]*)</td><td class="w">([^<]*)</td>', text))
    assert [rows[path] for path in ("detect.f_base_n", "react.compliance_m_s_n")] == ["N", "(m/s)/N"]


@pytest.mark.slow
def test_an_hour_stays_small(panda_model, paper_skin):
    steps = [made.step(panda_model, stamp=0.01 * i) for i in range(100)]
    many = made.recorded(panda_model, paper_skin, [])
    rng = np.random.default_rng(1)
    noise = 5 * rng.standard_normal((6_000, 3))
    for i in range(6_000):
        near = [(k, "panda_hand", 0.5 + 0.1 * noise[i, 0], 0.6) for k in range(2)]
        mode = Mode.REACT if i % 50 < 5 else Mode.TRACK
        step = replace(steps[i % 100], stamp=0.6 * i, force=noise[i], filtered_force=noise[i], mode=mode)
        many.kept.append(made.Kept(0, None, replace(step, obstacles=made.seen(panda_model, near))))
    assert len(page(measure(many, "hour"))) < 3e6


def test_numbers_as_they_are_written():
    assert number(None, 2) == number(float("nan"), 2) == number(float("inf"), 2) == "–"
    assert number(-1.234, 2) == "−1.23"
    assert number(-0.001, 2) == "0.00"
    assert percent(0.256) == "26 %"
    assert percent(float("nan")) == "–"
    assert "<td>&lt;b&gt;</td>" in table([{"a": "", "b": "<b>"}])
    assert bad("<") == '<span class="bad">&lt;</span>'


def test_a_detector_without_thresholds_is_not_said_to_have_them(reader, panda_model, paper_skin):
    ours = read(made.played(panda_model, paper_skin, "pretouch", seconds=1.5)[0])
    assert "bands in which one sample of it alone would be no contact" in ours.said
    assert "contact thresholds by axis" not in ours.said
    assert "contact thresholds by axis" in reader.said
