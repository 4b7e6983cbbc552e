# What the rules share.


def text_of(path):
    """A file of the workflow, wherever it is read from."""
    return Path(workflow.source_path(path)).read_text(encoding="utf-8")


def code(script, *modules):
    """A parameter that changes when a script does, or anything that it, or a module, rests on."""
    # jobs are told by the main process what to do
    return SOURCES.digest(script, *modules) if workflow.is_main_process else ""


def by(name):
    """Parameters of a rule whose figure or table a function of the package makes."""
    return {"by": name, "code": code("publish", f"imuarray_papers.{name.rpartition('.')[0]}")}


def asked():
    """The targets; in the process of a job None."""
    return workflow.dag_settings.targets if workflow.is_main_process else None


SOURCES = Sources(lambda script: text_of(f"../scripts/{script}.py"))
