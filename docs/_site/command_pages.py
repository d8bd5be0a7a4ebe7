"""The directive `commands`: every `vdsm` command, from its own help."""

from typing import Any

import typer
from docutils import nodes
from docutils.parsers.rst import Directive
from docutils.statemachine import StringList

from vdsm_pin.cli import app


def command_page(name: str, command: Any) -> str:
    """One command as Markdown: what it does, arguments and options, examples."""
    context = command.context_class(command, info_name=f"vdsm {name}")
    usage = " ".join(command.collect_usage_pieces(context))
    lines = [f"## vdsm {name}", "", command.help or "", ""]
    lines += ["```text", f"vdsm {name} {usage}", "```", ""]
    records = [parameter.get_help_record(context) for parameter in command.params]
    for words, meaning in filter(None, records):
        lines += [f"`{words}`", f": {meaning}", ""]
    if command.epilog:
        examples = command.epilog.removeprefix("\b\nExamples:\n").splitlines()
        lines += ["```text", *(line.strip() for line in examples), "```", ""]
    return "\n".join(lines)


class Commands(Directive):
    """All commands, in the order of `vdsm --help`."""

    def run(self) -> list[nodes.Node]:
        """Read the pages as Markdown, where the directive stands."""
        commands = typer.main.get_command(app).commands.items()  # type: ignore[attr-defined]
        text = "\n".join(command_page(*item) for item in commands)
        where = nodes.Element()
        lines = StringList(text.splitlines(), source="vdsm --help")
        self.state.nested_parse(lines, self.content_offset, where, match_titles=True)
        return where.children


def setup(app: Any) -> dict[str, bool]:
    """Make the directive known to Sphinx."""
    app.add_directive("commands", Commands)
    return {"parallel_read_safe": True}
