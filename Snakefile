"""Raw files of a fleet in, registry and pages out. `snakemake --config turnouts=ID` does it for one turnout."""

from snakemake.exceptions import WorkflowError
from snakemake.utils import min_version

from turnout.workflow.launch import TurnoutError, launch, quote_interpreter
from turnout.workflow.registry_copy import copy_list, restore_list
from turnout.readers.formats import FORMATS
from turnout.units import to_si

min_version("9.14")

try:
    quote_interpreter()
    RUN = launch(config, scan=workflow.is_main_process, formats=FORMATS, to_si=to_si)
except (
    TurnoutError
) as error:  # of an input: its message stands alone, without the lines of the program
    raise WorkflowError(str(error)) from None


onstart:
    copy_list()


onerror:
    restore_list()


localrules:
    all,
    verdict,


include: "rules/common.smk"
include: "rules/hammer.smk"
include: "rules/passage.smk"
include: "rules/mismatch.smk"
include: "rules/registry.smk"
include: "rules/trend.smk"
include: "rules/change.smk"
include: "rules/report.smk"
include: "rules/simulation.smk"


rule all:
    default_target: True
    input:
        TARGETS,
