# What the rules share.


def text_of(path):
    """A file of the workflow, wherever it is read from."""
    return Path(workflow.source_path(path)).read_text(encoding="utf-8")


def code(script, *modules):
    """A parameter that changes when a script does, or anything that it, or a module, rests on."""
    # jobs are told by the main process what to do
    return SOURCES.digest(script, *modules) if workflow.is_main_process else ""


def asked():
    """The targets; in the process of a job None."""
    return workflow.dag_settings.targets if workflow.is_main_process else None


def sections(*names):
    """The parameter `settings` of a rule that rests on these sections of the configuration."""
    return lambda wc: effective(config, wc.scale, *names)


def of_samples(path, samples=SAMPLES, **more):
    """Files below results/{scale}/ of each T of paper 2021."""
    return expand(f"results/{{scale}}/{path}", samples=samples, allow_missing=True, **more)


def of_board(path):
    """Files of all recordings of the board {group} that went through the first-order calibration."""
    return lambda wc: expand(path, name=MEASURED.board(wc.group))


def draw(
    by, message, input={}, folder="results/{scale}", output="", category="", caption="", **params
):
    """Have a rule in drawings.smk for what a function of imuarray_papers.figures makes of ``input``.

    The rule is called as the function, figure_... or table_...; the rest of that is the name of its
    ``output`` and of the ``caption``, unless they are given.
    """
    source, _, function = by.rpartition(".")
    kind, _, own = function.partition("_")
    place = f"{kind}s/{output or own}"
    DRAWINGS[function] = {
        "input": input,
        "output": drawn(kind, output or own, category, caption or own, folder),
        "log": f"{folder}/logs/{place}.log",
        "benchmark": f"{folder}/benchmarks/{place}.tsv",
        "params": {
            "by": f"figures.{by}",
            "code": code("publish", f"imuarray_papers.figures.{source}"),
            **params,
        },
        "message": message,
    }


DRAWINGS = {}
SOURCES = Sources(lambda script: text_of(f"../scripts/{script}.py"))
