# The stability study, whose jobs share out scenarios; the other studies are among the stages.


# The scan's breast on meshes of all sizes.
rule stability_scan_mesh:
    input:
        scan=tracked(Path(CONFIG.stability_scan)) if CONFIG.stability_scan else [],
    output:
        named("stability_scan_mesh", "stability"),
    log:
        log_of("stability_scan_mesh"),
    benchmark:
        benchmark_of("stability_scan_mesh")
    resources:
        mem_mb=memory_of("stability_scan_mesh"),
        runtime=minutes_of("stability_scan_mesh"),
    params:
        settings=settings_of("stability_scan_mesh"),
        code=stage_digest("stability_scan_mesh"),
        subject=subject_of,
        sources={"scan": CONFIG.stability_scan} if CONFIG.stability_scan else {},
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
        mem_mb=memory_of("stability_batch"),
        runtime=minutes_of("stability_batch"),
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
        *beside("stability"),
    log:
        log_of("stability"),
    benchmark:
        benchmark_of("stability")
    resources:
        mem_mb=memory_of("stability"),
        runtime=minutes_of("stability"),
    params:
        settings=settings_of("stability"),
        code=stage_digest("stability"),
        subject=subject_of,
    message:
        "stability: table and picture"
    script:
        "../scripts/stage.py"
