"""The interpreter of URScript: what it computes, and what it refuses with line and word."""

import pytest
from skillframe_ur.urscript import Program, ScriptError


def run(*lines, helper=()):
    """What a program said, and in how many cycles it ended."""
    said = []
    robot = {
        "sync": lambda: None,
        "say": lambda *values, **named: said.append((*values, named)),
        "q": lambda: (1.5,) * 6,
    }
    text = "\n".join(["def main():", *helper, *lines, "end", ""])
    return said, len(list(Program(text, robot, {"sync"}).run()))


def test_blocks_branches_and_functions_run_as_written():
    helper = [
        "def sign(x):", "if x > 0.0:", "return 1", "elif x < 0.0:", "return -1", "else:", "return 0", "end", "end",
    ]  # fmt: skip
    said, cycles = run(
        "local i = 0 # a comment",
        "local word = \"a # b\"",
        "while i < 3 and not (i == 5 or False):",
        "say(word, sign(i - 1.0), third=i)",
        "i = i + 1",
        "sync()",
        "end",
        helper=helper,
    )  # fmt: skip
    assert said == [("a # b", -1, {"third": 0}), ("a # b", 0, {"third": 1}), ("a # b", 1, {"third": 2})]
    assert cycles == 3


def test_lists_matrices_and_poses_calculate_as_the_manual_says():
    said, _ = run(
        "local m = [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]",
        "local p1 = p[1.0, 2.0, 3.0, 0.0, 0.0, 0.0]",
        "local b = [10.0, 20.0] * [3.0, 4.0] - 1",
        "local a = b",
        "a[1] = 0.5",
        "m[2,1] = 7",
        "say((m * [10, 20])[2], (transpose(m) * m)[0,1], a[1], b[1], p1[2], norm([3.0, 4.0]), q()[5])",
        "say(2.0 + 3.0 * -2.0, 7 / 2.0, inv([[2.0, 0.0], [0.0, 4.0]])[1,1], atan2(1.0, -1.0), length(b))",
    )  # fmt: skip
    assert said[0] == (190.0, 49.0, 0.5, 79.0, 3.0, 5.0, 1.5, {})
    assert said[1] == (-4.0, 3.5, 0.25, pytest.approx(2.356194490192345), 2, {})


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("movel(x)", "line 2: the function 'movel' is not known"),
        ("local a = b", "line 2: 'b' is not known here"),
        ("a = 1", "line 2: 'a' is assigned before it is declared local"),
        ("local a = 1 % 2", "line 2: '%' is not understood"),
        ("global a = 1", "line 2: 'global' is not understood here"),
        ("local a = 1 2", "line 2: '2' is not understood here"),
        ("local a = (1", "line 2: the end of the line where '\\)' is expected"),
        ("thread b():", "line 2: 'thread' is not understood here"),
        ("local sync = 1", "line 2: 'sync' is not understood here"),
        ("local a = sync()", "line 2: 'sync' takes a cycle"),
        ("else:", "line 2: 'else' after an empty block"),
        ("local a = 1 / 2", "line 2: a quotient of whole numbers"),
        ("local a = [[1.0]] + [[1.0]]", "line 2: '\\+' between values with 2 and 2 dimensions is not in the manual"),
        ("local a = [1.0] * [1.0, 2.0]", "line 2: '\\*' between lists of 1 and 2"),
        ("local a = [1.0][1]", "line 2: index 1 is out of bounds"),
        ("local a = [1.0][0.0]", "line 2: 0.0 is no index"),
        ("local a = 1.0 / 0.0", "line 2: float division by zero|line 2: division by zero"),
        ("local a = not 1", "line 2: 1 is neither True nor False"),
        ("say(1.0 + True)", "line 2: True is no number"),
        ("say(q() + 1.0)", "line 2: .* is no number"),
        ("local a = sqrt(-1.0)", "line 2: math domain error|line 2: expected a nonnegative"),
        ("local a = inv([[0.0]])", "line 2: Singular matrix"),
    ],
)
def test_what_it_does_not_know_is_refused_with_line_and_word(line, said):
    with pytest.raises(ScriptError, match=said):
        run(line)


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["local a = 1", "a = 1.0"], "line 3: the variable would change its type or size"),
        (["local a = [1.0]", "a = [1.0, 2.0]"], "line 3: the variable would change"),
        (["local a = 0", "while True:", "a = a + 1", "end"], "line 3: .* would run for ever"),
        (["if False:", "local a = 1", "end", "say(a)"], "line 5: a variable has no value yet"),
        (["while True:", "sync()"], "line 4: the program ends within a block"),
        (["while True:", "sync()", "else:"], "line 4: 'else' without an 'if'"),
        (["end", "end"], "line 3: 'end' outside of the program"),
        (["say(norm(3))"], "line 2: "),
        (["say(transpose(5.0))"], "line 2: "),
        (["local i = 3", "while True:", "i = i * i", "end"], "line 4: a whole number has 32 bits"),
        (["def again(x):", "return again(x)", "end", "say(again(1))"], "line 3: "),
        (["def twice(x, x):", "return 1", "end"], "line 2: "),
    ],
)
def test_a_program_that_goes_wrong_is_refused_at_its_line(lines, said):
    with pytest.raises(ScriptError, match=said):
        run(*lines)


def test_functions_see_their_own_variables_only_and_take_no_cycle():
    for body, said in (("return a", "'a' is not known"), ("sync()", "'sync' takes a cycle"), ("x = 1", "a parameter")):
        with pytest.raises(ScriptError, match=f"line 3: .*{said}"):
            run("local a = 1", helper=["def f(x):", body, "end"])
    with pytest.raises(ScriptError, match="not at the beginning"):
        run("local a = 1", "def f(x):", "return x", "end")
