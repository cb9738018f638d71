"""What a user sees while a run goes on: quiet runs, log files, the time left without compiling, every command named."""

import io
import re
import time
from pathlib import Path
from types import SimpleNamespace

import numba
import pytest
from IPython.core.formatters import DisplayFormatter
from rich.console import Console

import tribodyn
from tests.helpers.synthetic_result import result
from tribodyn.workflows.command import main as cli
from tribodyn.workflows.run import progress


def test_an_unknown_command_is_answered_with_all_of_them(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        cli.main(["fly"])
    message = capsys.readouterr().err
    assert stop.value.code == 2
    for name in cli.WORDS:
        assert re.search(rf"\b{name}\b", message), name


def test_quiet_prints_nothing_and_the_log_has_every_line(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(progress, "NOTE_EVERY", 0.0)
    messages = progress.console_progress(quiet=True, log=tmp_path / "logs" / "run.log")
    messages.say("a sentence")
    with messages.stage("mesh"):
        pass
    with messages.track("wear") as advance:
        advance(0.5, "step 1")
    assert capsys.readouterr().out == ""
    lines = (tmp_path / "logs" / "run.log").read_text().splitlines()
    assert [re.sub(r"^\S+ ", "", line)[:10] for line in lines] == [
        "a sentence",
        "mesh: 0.0 ",
        "wear: 50%,",
        "wear: 0.0 ",
    ]
    with pytest.raises(ValueError, match=r"--log .* cannot be written"):
        progress.console_progress(log=tmp_path)


def test_compiling_does_not_count_for_the_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "NOTE_EVERY", 0.0)
    console = Console(record=True, force_terminal=False, width=200)
    with progress.Progress(console).track("work") as advance:
        start = progress.compiled()

        @numba.njit
        def kernel(x: float) -> float:
            return sum([x * i for i in range(10)])

        kernel(1.0)
        spent = progress.compiled() - start
        time.sleep(0.3)
        advance(0.1, "")
    assert spent > 0
    message = console.export_text()
    remaining = float(re.search(r"10%, (\d+) s left", message).group(1))  # type: ignore[union-attr]
    assert remaining <= 9 * 0.3 + 2  # the kernel's seconds are not in it
    assert ("compiled for" in message) == (spent >= 1)


def test_a_notebook_shows_numbers_response_and_part() -> None:
    shell = SimpleNamespace(display_formatter=DisplayFormatter())
    tribodyn._show_results_in(shell)
    html = shell.display_formatter.format(result())[0]["text/html"]
    assert "preload" in html
    assert 'src="data:image/png;base64,' in html
    assert "<iframe" in html
    assert "mesh3d" in html


def test_the_bar_of_a_terminal_counts_compiling_apart_and_shows_what_goes_on(tmp_path: Path) -> None:
    """On a terminal: share, time left without compiling, peak, preload and depth; the log has lines besides."""
    console = Console(record=True, force_terminal=True, width=220, file=io.StringIO())
    with progress.Progress(console, tmp_path / "run.log").track("wear") as advance:
        time.sleep(0.2)
        advance(0.25, "step 3, peak 500 Hz and 1 mm, preload 20 N, depth 0.3 mm")
        time.sleep(0.2)
    message = console.export_text(styles=False)
    match = re.search(r"25%.* (\d+) s left; step 3, peak 500 Hz and 1 mm, preload 20 N, depth 0.3 mm", message)
    assert int(match.group(1)) <= 3
    assert (tmp_path / "run.log").read_text().splitlines()[-1].split(" ", 1)[1].startswith("wear: 0.")


def test_the_time_left_is_that_of_the_steady_work() -> None:
    start = time.perf_counter() - 70.0
    assert progress.time_left(0.5, start, 60.0) == "10 s left (compiled for 60 s, once)"
    assert progress.time_left(0.01, start, 60.0) == "(compiled for 60 s, once)"
    assert progress.time_left(1.0, start, 0.0) == "0 s left"
    assert progress.time_left(1.5, start, 0.0) == ""


def test_every_help_has_an_example_that_can_be_read(capsys: pytest.CaptureFixture[str]) -> None:
    words = [(name,) for name in cli.WORDS]
    words += [(*word, name) for word in words for name in cli.app[word[0]] if not name.startswith("-")]
    for word in [(), *words]:
        with pytest.raises(SystemExit):
            cli.main([*word, "--help"])
        example = re.search(r"Example: tribodyn (.*?)(\n\s*\n|$)", capsys.readouterr().out, re.DOTALL).group(1).split()
        assert tuple(example[: len(word)]) == word
        cli.app.parse_args(example, exit_on_error=False, print_error=False)


def test_without_a_terminal_a_line_comes_while_nothing_else_is_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "NOTE_EVERY", 0.2)
    console = Console(record=True, force_terminal=False, width=200, file=io.StringIO())
    with progress.Progress(console, details=False).stage("reduction"):
        time.sleep(1.1)
    assert re.fullmatch(r"(reduction: [01] s so far\n){3,5}", console.export_text())


def test_a_result_in_a_prompt_is_a_few_lines() -> None:
    lines = repr(result()).splitlines()
    assert 4 <= len(lines) <= 10
    assert max(map(len, lines)) <= 120
