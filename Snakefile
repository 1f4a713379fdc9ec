# From two tables to lesions in mammograms and MR volumes: see config/README.md.
from snakemake.utils import min_version

min_version("9.27")


configfile: f"{workflow.basedir}/config/config.yaml"


include: "workflow/rules/common.smk"
include: "workflow/rules/digital.smk"
include: "workflow/rules/stages.smk"
include: "workflow/rules/studies.smk"


localrules:
    all,
    complete,


rule all:
    default_target: True
    input:
        complete_file(),
