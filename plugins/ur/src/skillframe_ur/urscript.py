"""An interpreter of the part of URScript that `skillframe_ur.program` writes, for rehearsals and tests.

A program is one `def NAME(): ... end` with functions at its beginning. Known are `local`, assignments also to elements,
`if`, `elif`, `else`, `while`, `return`, `and`, `or`, `not`, comparisons, `+ - * /`, numbers, strings, lists, matrices
and poses. Everything else is refused, with line and word, and so is what the maker's script manual does not promise:
sums of matrices, quotients of whole numbers, a variable that changes its type, and one that is not declared `local`.

Each line is translated into the Python line of the same number. The program becomes a generator that yields where it
takes a cycle of the controller.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any

import numpy as np

from skillframe.errors import SkillframeError
from skillframe_ur.script_values import MATHEMATICS, OPERATIONS

TOKEN = re.compile(
    r'\s*(?:(?P<number>\d+\.\d+|\d+)|(?P<name>[A-Za-z_]\w*)|(?P<string>"[^"\\]*")|(?P<sign>[<>=!]=|[-+*/<>=(),:\[\]]))'
)
LEVELS = ({"or"}, {"and"}, {"<", ">", "<=", ">=", "=="}, {"+", "-"}, {"*", "/"})
"""Binary operators, the weakest first."""
WORDS = {
    "def", "end", "if", "elif", "else", "while", "return", "local", "and", "or", "not", "True", "False", "global",
    "thread", "break", "continue", "for", "run", "join", "kill", "halt", "pause", "xor",
}  # fmt: skip
"""Keywords of the language, which are no names."""


class ScriptError(SkillframeError):
    """A program that is not understood, or fails. The text has line and word."""

    def __init__(self, line: int, text: str) -> None:
        super().__init__(f"line {line}: {text}")


class Program:
    """A program that is run cycle by cycle.

    Args:
        text: of the program.
        robot: functions of the robot by name. Poses are tuples of six numbers, lists and matrices arrays.
        waits: those among them, called as statements of the program itself, that take a cycle of the controller.

    Raises:
        ScriptError: the text is not in the known part of the language.
    """

    def __init__(self, text: str, robot: Mapping[str, Callable[..., Any]], waits: Collection[str]) -> None:
        self._rounds = 0
        known = {**MATHEMATICS, **robot}
        names: dict[str, Any] = {**OPERATIONS, "loop": self._loop, "__builtins__": {}}
        names.update({f"f_{name}": function for name, function in known.items()})
        translated = _Translation(text, set(known), waits)
        try:
            exec(compile(translated.python(), FILE, "exec"), names)  # a text made of known words alone
        except SyntaxError as error:
            raise ScriptError(error.lineno or 1, f"is not understood ({error.msg})") from None
        self._start: Callable[[], Iterator[None]] = names[f"f_{translated.name}"]

    def _loop(self, condition: bool) -> bool:
        self._rounds += 1
        if self._rounds > 10_000:
            raise TypeError("the loop takes no cycle of the controller, and would run for ever")
        return condition

    def run(self) -> Iterator[None]:
        """Run the program, a cycle of the controller at each step.

        Raises:
            ScriptError: a statement fails.
        """
        try:
            for _ in self._start():
                self._rounds = 0
                yield
        except (
            TypeError, ValueError, IndexError, NameError, AttributeError, ArithmeticError, RecursionError,
            np.linalg.LinAlgError,
        ) as error:  # fmt: skip
            trace, line = error.__traceback__, 0
            while trace is not None:
                line = trace.tb_lineno if trace.tb_frame.f_code.co_filename == FILE else line
                trace = trace.tb_next
            if not line:
                raise
            text = "a variable has no value yet" if isinstance(error, NameError) else str(error)
            raise ScriptError(line, text) from None


FILE = "<urscript>"


class _Translation:
    """The translation of a text into Python, line by line."""

    def __init__(self, text: str, known: set[str], waits: Collection[str]) -> None:
        self._known, self._waits, self._text = known, waits, text
        self._words: list[str] = []
        self._place = self._line = 0
        self._blocks: list[tuple[str, int]] = []  # kind and first line of each block that is open
        self._locals: list[set[str]] = []
        self._parameters: list[str] = []
        self._empty = False
        self.name = ""

    def python(self) -> str:
        """The Python text. Raises `ScriptError` for what is not understood."""
        lines = []
        for line in self._text.removesuffix("\n").split("\n"):
            self._line += 1
            self._words, self._place = _words(line, self._line), 0
            lines.append(self._translated() if self._words else "")
        if self._blocks or not self.name:
            raise ScriptError(max(self._line, 1), "the program ends within a block: an 'end' is missing")
        return "\n".join(lines) + "\n"

    @property
    def _word(self) -> str:
        return self._words[self._place] if self._place < len(self._words) else ""

    def _take(self, wanted: str = "") -> str:
        word = self._word
        if not word or (wanted and word != wanted):
            found = repr(word) if word else "the end of the line"
            raise ScriptError(self._line, f"{found} where {repr(wanted) if wanted else 'a value'} is expected")
        self._place += 1
        return word

    def _new(self) -> str:
        name = self._take()
        if name in self._known or name in WORDS or not name[0].isalpha():
            raise ScriptError(self._line, f"{name!r} is not understood here")
        return name

    def _translated(self) -> str:
        """The line, which has words."""
        word, deep = self._word, len(self._blocks)
        if not self._blocks and (self.name or word != "def"):
            raise ScriptError(self._line, f"{word!r} outside of the program: a text is one def without parameters")
        if word in ("end", "elif", "else"):
            made = self._next_branch(word)
            deep -= word != "end"
        else:
            made = self._statement(word)
            self._empty = word in ("def", "if", "while")
        if self._word:
            raise ScriptError(self._line, f"{self._word!r} is not understood here")
        return " " * deep + made

    def _next_branch(self, word: str) -> str:
        kind, _ = self._blocks[-1]
        if self._empty and word != "end":
            raise ScriptError(self._line, f"{word!r} after an empty block")
        self._take()
        if word == "end":
            self._blocks.pop()
            made = "pass" if self._empty else ""
            if kind == "def":
                self._locals.pop()
                self._parameters = []
                made = made if self._blocks else "if False: yield"  # a generator, even if nothing takes a cycle
            self._empty = False
            return made
        if kind != "if":
            raise ScriptError(self._line, f"{word!r} without an 'if'")
        made = f"elif truth({self._expression()}):" if word == "elif" else "else:"
        self._take(":")
        self._blocks[-1] = (kind if word == "elif" else word, self._line)
        self._empty = True
        return made

    def _statement(self, word: str) -> str:
        if word == "def":
            return self._definition()
        if word in ("if", "while"):
            self._take()
            condition = f"truth({self._expression()})"
            self._take(":")
            self._blocks.append((word, self._line))
            return f"if {condition}:" if word == "if" else f"while loop({condition}):"
        if word == "return":
            self._take()
            return f"return {self._expression()}"
        declares = word == "local"
        if declares:
            self._take()
        if self._words[self._place + 1 : self._place + 2] == ["("] and not declares:
            name = self._take()
            return self._call(name, alone=True) + ("; yield" if name in self._waits else "")
        return self._assignment(declares)

    def _definition(self) -> str:
        self._take()
        name, inner, parameters = self._new(), bool(self._blocks), []
        if len(self._blocks) > 1 or (inner and self._locals[0]):
            raise ScriptError(self._line, f"{name!r} is not at the beginning of the program")
        self._take("(")
        while self._word != ")":
            parameters.append(self._new())
            if self._word != ")":
                self._take(",")
        self._take(")")
        self._take(":")
        self._blocks.append(("def", self._line))
        self._locals.append(set(parameters))
        self._known.add(name)
        if not inner:
            self.name = name
            if parameters:
                raise ScriptError(self._line, f"the program {name!r} has parameters")
        self._parameters = parameters
        return f"def f_{name}({', '.join(f'v_{each}' for each in parameters)}):"

    def _assignment(self, declares: bool) -> str:
        name = self._new()
        new = name not in self._locals[-1]
        if name in self._parameters:
            raise ScriptError(self._line, f"{name!r} is a parameter, and is not assigned here")
        if new and not declares:
            raise ScriptError(self._line, f"{name!r} is assigned before it is declared local")
        index = "" if declares else self._index()
        self._take("=")
        value = self._expression()
        self._locals[-1].add(name)
        if index:
            return f"put(v_{name}, {value}, {index})"
        return f"v_{name} = copied({value})" if declares else f"v_{name} = kept(v_{name}, {value})"

    def _index(self) -> str:
        if self._word != "[":
            return ""
        self._take()
        found = self._expression()
        if self._word == ",":
            self._take()
            found += f", {self._expression()}"
        self._take("]")
        return found

    def _expression(self, level: int = 0) -> str:
        if level == 2 and self._word == "not":
            self._take()
            return f"(not truth({self._expression(level)}))"
        if level == len(LEVELS):
            return self._operand()
        left = self._expression(level + 1)
        while self._word in LEVELS[level]:
            sign = self._take()
            right = self._expression(level + 1)
            left = f"(truth({left}) {sign} truth({right}))" if level < 2 else f"{SIGNS[sign]}({left}, {right})"
        return left

    def _operand(self) -> str:
        word = self._take()
        if word == "-":
            return f"(-number({self._operand()}))"
        if word == "(":
            found = self._expression()
            self._take(")")
        elif word == "[":
            found = f"array({self._list()})"
        elif word == "p" and self._word == "[":
            self._take()
            found = f"pose({self._list()})"
        elif word[0] == '"' or word[0].isdigit() or word in ("True", "False"):
            found = word.lstrip("0") or "0" if word.isdigit() else word
        elif self._word == "(":
            found = self._call(word)
        elif word in self._locals[-1]:
            found = f"v_{word}"
        else:
            raise ScriptError(self._line, f"{word!r} is not known here")
        index = self._index()
        return f"element({found}, {index})" if index else found

    def _list(self) -> str:
        """The elements after "[": numbers, or rows of a matrix."""
        rows, found = self._word == "[", []
        while self._word != "]":
            if rows:
                self._take("[")
            found.append(self._list() if rows else self._expression())
            if self._word != "]":
                self._take(",")
        self._take("]")
        return f"[{', '.join(found)}]"

    def _call(self, name: str, *, alone: bool = False) -> str:
        if name not in self._known or name == self.name:
            raise ScriptError(self._line, f"the function {name!r} is not known")
        if name in self._waits and (len(self._locals) > 1 or not alone):
            raise ScriptError(self._line, f"{name!r} takes a cycle, and is known as a statement of the program alone")
        self._take("(")
        given = []
        while self._word != ")":
            if self._words[self._place + 1 : self._place + 2] == ["="]:
                keyword = self._take()
                self._take("=")
                given.append(f"{keyword}={self._expression()}")
            else:
                given.append(self._expression())
            if self._word != ")":
                self._take(",")
        self._take(")")
        return f"f_{name}({', '.join(given)})"


SIGNS = {
    "+": "plus", "-": "minus", "*": "times", "/": "over", "<": "below", ">": "above", "<=": "at_most", ">=": "at_least",
    "==": "equal",
}  # fmt: skip
"""Names in `OPERATIONS`."""


def _words(line: str, count: int) -> list[str]:
    """The words of a line without its comment."""
    words, at = [], 0
    while (rest := line[at:].strip()) and not rest.startswith("#"):
        found = TOKEN.match(line, at)
        if found is None:
            raise ScriptError(count, f"{rest.split()[0]!r} is not understood")
        words.append(found[0].strip())
        at = found.end()
    return words
