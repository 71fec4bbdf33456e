"""``slideviz completion``: the scripts have all of the tables, and real shells take them."""

import re
import shutil
import subprocess

import pytest

from slideviz.case.keys import KEYS
from slideviz.cli import run
from slideviz.cli.commands import COMMANDS
from slideviz.cli.completion_command import SHELLS, options
from slideviz.samples.table import SAMPLES


def script_of(shell, capsys):
    assert run(["completion", shell]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("shell", SHELLS)
def test_a_script_has_every_command_and_option(shell, capsys):
    text = script_of(shell, capsys)
    words = set(re.findall(r"[\w-]+", text))
    assert set(COMMANDS) <= words
    flags = {flag for some in options().values() for option in some for flag in option.flags}
    assert len(flags) > 50
    long = {flag[2:] if shell == "fish" else flag for flag in flags if flag.startswith("--")}
    assert long <= words
    assert set(KEYS) <= words


def shell_or_skip(shell):
    if shutil.which(shell) is None:
        pytest.skip(f"needs {shell}")


def said(*command):
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("slideviz qu", {"quality"}),
        ("slideviz run --steps", {"--steps", "--steps-dir", "--steps-file"}),
        ("slideviz section --color size", {"size-skew", "size"}),
        ("slideviz run --set RELA", {"RELAX="}),
        ("slideviz sample sta", {"stator"}),
        ("slideviz completion z", {"zsh"}),
        ("slideviz run --steps 3", set()),
    ],
)
@pytest.mark.parametrize("shell", ["bash", "fish"])
def test_the_shell_offers(shell, words, offered, capsys, tmp_path):
    shell_or_skip(shell)
    file = tmp_path / "script"
    file.write_text(script_of(shell, capsys), newline="\n")
    if shell == "fish":
        out = said("fish", "--no-config", "-c", f"source {file}; complete -C '{words}'")
        found = {line.split("\t")[0] for line in out.splitlines()}
    else:
        *before, _ = words.split()
        ask = (
            f"source {file}; COMP_WORDS=({words}); COMP_CWORD={len(before)}; "
            "compopt() { :; }; _slideviz; printf '%s\\n' \"${COMPREPLY[@]}\""
        )
        found = set(said("bash", "--norc", "-c", ask).split())
    assert found == offered


def test_zsh_takes_the_script(capsys, tmp_path):
    """It completes on a terminal only: here each command's arguments are read."""
    shell_or_skip("zsh")
    file = tmp_path / "_slideviz"
    file.write_text(script_of("zsh", capsys), newline="\n")
    ask = (
        f"autoload -U compinit; compinit -D; source {file}; "
        "_describe() { print -l ${commands%%:*} }; _files() { : }; "
        "_arguments() { print -l -- $@ }; "
        "words=(slideviz ''); CURRENT=2; _slideviz; words=(slideviz run ''); CURRENT=3; _slideviz"
    )
    out = said("zsh", "-f", "-c", ask)
    lines = out.splitlines()
    assert lines[: len(COMMANDS)] == list(COMMANDS)
    assert any(re.match(r"\*--output\[deformed mesh to write\]:MESH:_files", one) for one in lines)
    some = [flag for option in options()["run"] for flag in option.flags]
    assert len([one for one in lines if one.startswith("*-")]) == len(some)


def test_zsh_completes_at_the_first_tab(capsys, tmp_path):
    """From a folder of its path the file itself is the function, the first time."""
    shell_or_skip("zsh")
    (tmp_path / "_slideviz").write_text(script_of("zsh", capsys), newline="\n")
    ask = (
        f"fpath=({tmp_path} $fpath); autoload -Uz _slideviz; compdef() {{ print defined }}; "
        "_describe() { print -l ${commands%%:*} }; _files() { : }; "
        "words=(slideviz ''); CURRENT=2; _slideviz; print; _slideviz"
    )
    once = "\n".join(COMMANDS)
    assert said("zsh", "-f", "-c", ask) == f"{once}\n\n{once}\n"


def test_samples_are_completed_by_name(capsys):
    text = script_of("bash", capsys)
    assert re.search(rf"sample\) _slideviz_words .*{' '.join(SAMPLES)}", text)
