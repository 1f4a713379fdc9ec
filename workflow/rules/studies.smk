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


# The paper's Table I by laws and by finite elements; `snakemake table_1` asks for it.
rule table_1:
    output:
        named("table_1"),
        *(
            str(RESULTS / "tables" / f"table_1_forces.{form}")
            for form in ("csv", "md", "html")
        ),
    log:
        log_of("table_1"),
    benchmark:
        benchmark_of("table_1")
    resources:
        mem_mb=lambda wildcards, attempt: 700 * attempt,
        runtime=20,
    params:
        settings=settings_of("table_1"),
        code=stage_digest("table_1"),
        subject=subject_of,
    message:
        "cohort: table_1"
    script:
        "../scripts/stage.py"


# A volunteer's landmarks under the paper's materials, boundary conditions and skins.
rule volunteer:
    input:
        unpack(inputs_of("volunteer")),
    output:
        named("volunteer"),
    log:
        log_of("volunteer"),
    benchmark:
        benchmark_of("volunteer")
    resources:
        mem_mb=lambda wildcards, input, attempt: max(
            1200, 400 + 12 * int(input.size_mb)
        )
        * attempt,
        runtime=30,
    params:
        settings=settings_of("volunteer"),
        code=stage_digest("volunteer"),
        subject=subject_of,
    message:
        "{wildcards.case}: volunteer"
    script:
        "../scripts/stage.py"


# Tables II to IV beside the paper's; `snakemake paper_tables` asks for them.
rule paper_tables:
    input:
        volunteer=[named("volunteer").format(case=case) for case in volunteers()],
    output:
        named("paper_tables"),
        *(
            str(RESULTS / "tables" / f"{name}.csv")
            for name in (
                "table_2_materials",
                "table_3_boundary",
                "table_4_skin",
                "findings_tables_2_to_4",
            )
        ),
    log:
        log_of("paper_tables"),
    benchmark:
        benchmark_of("paper_tables")
    resources:
        mem_mb=700,
        runtime=10,
    params:
        settings=settings_of("paper_tables"),
        code=stage_digest("paper_tables"),
        subject=subject_of,
    message:
        "cohort: paper_tables"
    script:
        "../scripts/stage.py"


# The scan's breast on meshes of all sizes.
rule stability_scan_mesh:
    input:
        scan=CONFIG.stability_scan or [],
    output:
        named("stability_scan_mesh", "stability"),
    log:
        log_of("stability_scan_mesh"),
    benchmark:
        benchmark_of("stability_scan_mesh")
    resources:
        mem_mb=lambda wildcards, input, attempt: max(
            1500, 400 + 12 * int(input.size_mb)
        )
        * attempt,
        runtime=10,
    params:
        settings=settings_of("stability_scan_mesh"),
        code=stage_digest("stability_scan_mesh"),
        subject=subject_of,
    message:
        "stability: scan"
    script:
        "../scripts/stage.py"


# Some of the study's scenarios.
rule stability_batch:
    input:
        **stability_mesh(),
    output:
        named("stability_batch", "stability", ".{batch}.h5"),
    log:
        named("stability_batch", "logs", ".{batch}.log"),
    benchmark:
        named("stability_batch", "benchmarks", ".{batch}.tsv")
    resources:
        mem_mb=lambda wildcards, attempt: 1500 * attempt,
        runtime=120,
    params:
        settings=settings_of("stability_batch"),
        code=stage_digest("stability_batch"),
        subject=lambda wildcards: {"case": "cohort", "row": {"batch": wildcards.batch}},
    message:
        "stability: batch {wildcards.batch}"
    script:
        "../scripts/stage.py"


# Table, page and picture of the solver's stability; `snakemake stability` asks for it.
rule stability:
    input:
        stability_batch=expand(
            named("stability_batch", "stability", ".{batch}.h5"),
            batch=range(CONFIG.stability_batch.batches),
        ),
    output:
        named("stability"),
        str(RESULTS / "tables" / "stability.csv"),
    log:
        log_of("stability"),
    benchmark:
        benchmark_of("stability")
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        settings=settings_of("stability"),
        code=stage_digest("stability"),
        subject=subject_of,
    message:
        "stability: table and picture"
    script:
        "../scripts/stage.py"
