"""YAML to plain data with the line of every value; nothing else can come out.

Works on parse events, one by one, so that neither a tag can build an object, nor deep
nesting exhaust the stack, nor an alias expand without end. Plain scalars are read by
the core schema of YAML 1.2, but for its hexadecimal and octal numbers: `1e-3` is a
number; `no`, `12:30` and `0x1F` are text. Lines end as they do there: U+0085, U+2028
and U+2029 are signs like any other.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final, TypeAlias

import yaml

from vdsm_pin.errors import InvalidFile, InvalidInput

Scalar: TypeAlias = str | int | float | bool | None
Data: TypeAlias = "Scalar | list[Data] | dict[str, Data]"
Location: TypeAlias = tuple[str | int, ...]

MAX_DEPTH: Final = 32
MAX_VALUES: Final = 4_000_000
MAX_INTEGER_DIGITS: Final = 300

_NO_ENDS: Final = "\x85\u2028\u2029"
"""Signs that end a line in YAML 1.1, which the parser is for, and not in 1.2."""

_PRIVATE: Final = range(0xF0000, 0xFFFFE)

_INTEGER: Final = re.compile(r"[-+]?[0-9]+")
_FLOAT: Final = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_WORDS: Final[dict[str, Scalar]] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".inf", ".Inf", ".INF", "+.inf", "+.Inf", "+.INF"), float("inf")),
    **dict.fromkeys(("-.inf", "-.Inf", "-.INF"), float("-inf")),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan")),
}


@dataclass(frozen=True)
class YamlDocument:
    """One document.

    Args:
        file: The file as the user named it.
        data: Maps with text keys, lists, text, numbers, booleans, null.
        lines: Line of every value by its location, the keys and indices that lead to
            it; items on the line of their list are left out.
    """

    file: object
    data: Data
    lines: dict[Location, int]

    def invalid(self, at: Location, fault: str) -> InvalidFile:
        """The error that names a value by its field and line."""
        line = self.line(at)
        where = spelled(at)
        if line is not None:
            where = f"{where} (line {line})" if where else f"line {line}"
        return InvalidFile(file=self.file, where=where, fault=fault)

    def invalid_file(self, at: Location, name: str, error: InvalidFile) -> InvalidFile:
        """The same of a value that names a file, with what is wrong in that."""
        place = f" {error.where}:" if error.where else ""
        return self.invalid(at, f"{name!r}:{place} {error.fault}")

    @contextmanager
    def naming(self, at: Location) -> Iterator[None]:
        """Name a value where it makes what is done within invalid."""
        try:
            yield
        except InvalidFile:  # which names its place
            raise
        except InvalidInput as error:
            raise self.invalid(at, str(error)) from None

    def line(self, location: Location) -> int | None:
        """Line of a value, or of the closest thing around it that has one."""
        for end in range(len(location), -1, -1):
            if location[:end] in self.lines:
                return self.lines[location[:end]]
        return None


def spelled(location: Location) -> str:
    """A location as people write it: obstacles[2].radius."""
    text = "".join(f"[{s}]" if isinstance(s, int) else f".{s}" for s in location)
    return text.removeprefix(".")


def read_yaml(text: str, *, file: object) -> YamlDocument:
    """One YAML document as plain data; empty ones after it are no others.

    What ROS prints ends in `---`, which begins an empty document.

    Args:
        text: The whole file.
        file: The file as the user named it, for messages.

    Returns:
        The data with line numbers.

    Raises:
        InvalidFile: If it is not YAML, holds not exactly one document, repeats a key,
            names a tag of another language, nests too deep or is too large.
    """
    stand_ins = _stand_ins(text)
    plain = text.translate({ord(sign): code for code, sign in stand_ins.items()})
    events = yaml.parse(plain, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    try:
        return _Builder(events, file, stand_ins).document()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}" if mark else ""
        fault = f"is not YAML: {error.problem or error.context}"
        lines = plain.split("\n")[mark.line :] if mark else []
        if mark and lines and lines[0][mark.column :].startswith("\t"):
            fault = "is not YAML: has a tab, expected spaces"
        raise InvalidFile(file=file, where=where, fault=fault) from None
    except yaml.YAMLError as error:
        fault = f"is not YAML: {' '.join(str(error).split())}"
        raise InvalidFile(file=file, fault=fault) from None


def _stand_ins(text: str) -> dict[int, str]:
    """Codes that the text does not use for the signs that the parser mistakes."""
    used = set(text)
    signs = [sign for sign in _NO_ENDS if sign in used]
    free = (code for code in _PRIVATE if chr(code) not in used)
    return dict(zip(free, signs, strict=False))


@dataclass
class _Builder:
    """Recursive descent over events, with a budget.

    Args:
        events: Of the parser.
        file: For messages.
        stand_ins: Signs of the text by the codes that stand for them.
    """

    events: Iterator[yaml.Event]
    file: object
    stand_ins: dict[int, str]
    lines: dict[Location, int] = field(default_factory=dict)

    def document(self) -> YamlDocument:
        self.events = self._bounded(self.events)
        next(self.events)  # the start of the stream
        start = next(self.events)
        if not isinstance(start, yaml.DocumentStartEvent):
            raise InvalidFile(file=self.file, fault="holds no data")
        data = self._value(next(self.events), ())
        next(self.events)  # the end of the document
        while not isinstance(after := next(self.events), yaml.StreamEndEvent):
            if not _is_empty(next(self.events)):
                fault = "a second document starts here, expected one"
                raise self._invalid(after, fault)
            next(self.events)  # the end of the empty document
        return YamlDocument(self.file, data, self.lines)

    def _bounded(self, events: Iterator[yaml.Event]) -> Iterator[yaml.Event]:
        """The events, as long as they nest and number sanely."""
        depth = 0
        for count, event in enumerate(events):
            if isinstance(event, yaml.CollectionStartEvent):
                depth += 1
            elif isinstance(event, yaml.CollectionEndEvent):
                depth -= 1
            if depth > MAX_DEPTH:
                raise self._invalid(event, f"nests deeper than {MAX_DEPTH} levels")
            if count > MAX_VALUES:
                raise self._invalid(event, f"holds more than {MAX_VALUES} values")
            yield event

    def _value(self, event: yaml.Event, at: Location) -> Data:
        if isinstance(event, yaml.AliasEvent):
            fault = f"is an alias (*{event.anchor}); write the value out"
            raise self._invalid(event, fault)
        assert isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent)
        if event.tag is not None:
            fault = f"has the tag {event.tag!r}; a problem file holds plain data only"
            raise self._invalid(event, fault)
        if self.lines.get(at[:-1]) != _line(event):
            self.lines.setdefault(at, _line(event))
        if isinstance(event, yaml.ScalarEvent):
            value = str(event.value).translate(self.stand_ins)
            return _scalar(value) if event.implicit[0] else value
        mapping = isinstance(event, yaml.MappingStartEvent)
        return self._mapping(at) if mapping else self._sequence(at)

    def _mapping(self, at: Location) -> dict[str, Data]:
        data: dict[str, Data] = {}
        while not isinstance(key := next(self.events), yaml.MappingEndEvent):
            if not isinstance(key, yaml.ScalarEvent):
                raise self._invalid(key, "a key is not plain text")
            name = str(key.value).translate(self.stand_ins)
            if name in data:
                raise self._invalid(key, f"the key {name!r} appears twice")
            self.lines[(*at, name)] = _line(key)
            data[name] = self._value(next(self.events), (*at, name))
        return data

    def _sequence(self, at: Location) -> list[Data]:
        data: list[Data] = []
        while not isinstance(item := next(self.events), yaml.SequenceEndEvent):
            data.append(self._value(item, (*at, len(data))))
        return data

    def _invalid(self, event: yaml.Event, fault: str) -> InvalidFile:
        line = _line(event)
        return InvalidFile(file=self.file, where=f"line {line}", fault=fault)


def _scalar(text: str) -> Scalar:
    """A plain scalar, see the module."""
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text) and len(text) <= MAX_INTEGER_DIGITS:
        return int(text)
    return float(text) if _FLOAT.fullmatch(text) else text


def _is_empty(event: yaml.Event) -> bool:
    """Whether nothing is written where a value could stand."""
    if not isinstance(event, yaml.ScalarEvent) or event.anchor or event.tag:
        return False
    return bool(event.implicit[0] and not event.value)


def _line(event: yaml.Event) -> int:
    assert event.start_mark is not None
    return event.start_mark.line + 1
