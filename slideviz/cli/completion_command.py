"""``slideviz completion``: what the Tab key completes in a shell, from the tables of commands."""

from __future__ import annotations

from argparse import Action, Namespace, _SubParsersAction
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from slideviz.case.keys import KEYS
from slideviz.cli.commands import COMMANDS
from slideviz.cli.terminal import DONE
from slideviz.samples.table import SAMPLES
from slideviz.terms import Texts


class Option(NamedTuple):
    """An argument of a command, as a shell sees it."""

    flags: Texts  # none of a positional argument
    words: str  # its help
    values: Texts  # values to choose from
    takes: str  # what its value is called; "" of a switch
    is_path: bool


def main(arguments: Namespace) -> int:
    """Print the script of a shell; return the exit code."""
    print(SHELLS[arguments.shell]())
    return DONE


def options() -> dict[str, list[Option]]:
    """Return the arguments of each command."""
    # Late: the parser imports this module's table of commands.
    from slideviz.cli.parser import command_parser

    actions = command_parser(COMMANDS)._actions
    calls = next(action for action in actions if isinstance(action, _SubParsersAction))
    return {name: list(map(_option, call._actions)) for name, call in calls.choices.items()}


def _option(action: Action) -> Option:
    name = action.metavar or action.dest
    values: tuple[Any, ...] = tuple(action.choices or ())
    if "--set" in action.option_strings:
        values = tuple(f"{key}=" for key in KEYS)
    elif action.dest == "name":
        values = tuple(SAMPLES)
    takes = "" if action.nargs == 0 else str(name)
    words = " ".join((action.help or "").replace("%%", "%").split())
    return Option(tuple(action.option_strings), words, values, takes, action.type is Path)


def _bash() -> str:
    lines = []
    for name, some in options().items():
        for option in some:
            after = "|".join(f'"{name} {flag}"' for flag in option.flags)
            if after and option.values:
                lines.append(f"        {after}) _slideviz_words {_joined(option.values)}; return;;")
            elif after and option.takes:
                files = "" if option.is_path else " compopt +o default;"
                lines.append(f"        {after}){files} return;;")
    lines += ["    esac", '    case "$command" in']
    for name, some in options().items():
        flags = [flag for option in some for flag in option.flags]
        values = [value for option in some if not option.flags for value in option.values]
        words = _joined([*flags, *values])
        lines.append(f"        {name}) _slideviz_words {words};;")
    return _BASH.format(commands=_joined(COMMANDS), cases="\n".join(lines))


_BASH = """\
# Completion of slideviz for bash: made by `slideviz completion bash`.
_slideviz_words() {{
    COMPREPLY=($(compgen -W "$*" -- "$current"))
    # A key goes on with its value.
    [[ ${{COMPREPLY[0]}} == *= ]] && compopt -o nospace
}}
_slideviz() {{
    local current=${{COMP_WORDS[COMP_CWORD]}} command=${{COMP_WORDS[1]}}
    COMPREPLY=()
    if ((COMP_CWORD == 1)); then
        _slideviz_words {commands} --help --version --run
        return
    fi
    case "$command ${{COMP_WORDS[COMP_CWORD - 1]}}" in
{cases}
    esac
}}
# Where nothing fits, files do.
complete -o default -F _slideviz slideviz"""


def _zsh() -> str:
    lines = []
    for name, some in options().items():
        lines.append(f"        {name}) _arguments \\")
        lines += [f"            {spec} \\" for option in some for spec in _zsh_specs(option)]
        lines.append("            ;;")
    commands = "\n".join(f"        {_quoted(f'{k}:{row.help}')}" for k, row in COMMANDS.items())
    return _ZSH.format(commands=commands, cases="\n".join(lines))


def _zsh_specs(option: Option) -> Iterator[str]:
    values = f"({_joined(option.values)})" if option.values else ""
    action = values or ("_files" if option.is_path else " ")
    takes = f":{_plain(option.takes)}:{action}" if option.takes else ""
    if not option.flags:
        yield _quoted(f"*{takes}")
    for flag in option.flags:
        yield _quoted(f"*{flag}[{_plain(option.words)}]{takes}")


_ZSH = """\
#compdef slideviz
# Completion of slideviz for zsh: made by `slideviz completion zsh`.
_slideviz() {{
    local -a commands
    commands=(
{commands}
    )
    if ((CURRENT == 2)); then
        _describe -t commands command commands
        _files
        return
    fi
    shift words
    ((CURRENT--))
    case $words[1] in
{cases}
    esac
}}
# From a folder of $fpath it is this function's body at the first Tab, and is to complete.
if [[ $funcstack[1] == _slideviz ]]; then
    _slideviz "$@"
else
    compdef _slideviz slideviz
fi"""


def _fish() -> str:
    lines = ["# Completion of slideviz for fish: made by `slideviz completion fish`."]
    for name, row in COMMANDS.items():
        words = f"-a {name} -d {_quoted(row.help)}"
        lines.append(f"complete -c slideviz -n __fish_use_subcommand {words}")
    for name, some in options().items():
        for option in some:
            parts = ["complete -c slideviz -n", _quoted(f"__fish_seen_subcommand_from {name}")]
            parts += [
                f"-l {flag[2:]}" if flag.startswith("--") else f"-s {flag[1:]}"
                for flag in option.flags
            ]
            if option.flags and option.takes:
                parts.append("-r -F" if option.is_path else "-x")
            if option.values:
                parts.append(f"-a {_quoted(_joined(option.values))}")
            if option.flags or option.values:
                lines.append(" ".join([*parts, "-d", _quoted(option.words)]))
    return "\n".join(lines)


def _joined(values: Any) -> str:
    return " ".join(map(str, values))


def _plain(text: str) -> str:
    """Return a text without the signs that zsh's ``_arguments`` reads."""
    return text.translate(str.maketrans("[]:", "(),"))


def _quoted(text: str) -> str:
    """Return a text in single quotes, for any of the shells."""
    return "'" + text.replace("'", "’") + "'"


SHELLS = {"bash": _bash, "zsh": _zsh, "fish": _fish}
"""The shells, each with the function that returns its script."""
