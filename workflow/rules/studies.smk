# Studies: targets of their own, not part of the default run.


# Error and time of each method on meshes of several sizes.
rule runtime:
    input:
        unpack(inputs_of("runtime")),
    output:
        named("runtime"),
    log:
        log_of("runtime"),
    benchmark:
        benchmark_of("runtime")
    resources:
        mem_mb=lambda wildcards, input, attempt: max(
            1500, 400 + 12 * int(input.size_mb)
        )
        * attempt,
        runtime=60,
    params:
        settings=settings_of("runtime"),
        code=stage_digest("runtime"),
        subject=subject_of,
    message:
        "{wildcards.case}: runtime"
    script:
        "../scripts/stage.py"


# Table and picture of that study; `snakemake error_vs_runtime` asks for it.
rule error_vs_runtime:
    input:
        unpack(inputs_of("error_vs_runtime")),
    output:
        named("error_vs_runtime"),
        str(RESULTS / "tables" / "error_vs_runtime.csv"),
    log:
        log_of("error_vs_runtime"),
    benchmark:
        benchmark_of("error_vs_runtime")
    resources:
        mem_mb=lambda wildcards, input, attempt: max(
            1000, 400 + 12 * int(input.size_mb)
        )
        * attempt,
        runtime=10,
    params:
        settings=settings_of("error_vs_runtime"),
        code=stage_digest("error_vs_runtime"),
        subject=subject_of,
    message:
        "cohort: error_vs_runtime"
    script:
        "../scripts/stage.py"
