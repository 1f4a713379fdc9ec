# From the files of one case to where its lesions lie; every rule is a stage of the same name.


# Breast, tissues, chest wall and nipple in the MR volume.
rule segment:
    input:
        unpack(inputs_of("segment")),
    output:
        named("segment"),
    log:
        log_of("segment"),
    benchmark:
        benchmark_of("segment")
    resources:
        mem_mb=lambda wildcards, input, attempt: max(
            900, 400 + 12 * int(input.size_mb)
        )
        * attempt,
        runtime=5,
    params:
        settings=settings_of("segment"),
        code=stage_digest("segment"),
        subject=subject_of,
    message:
        "{wildcards.case}: segment"
    script:
        "../scripts/stage.py"


# Hexahedral mesh of the undeformed breast.
rule mesh:
    input:
        unpack(inputs_of("mesh")),
    output:
        named("mesh"),
    log:
        log_of("mesh"),
    benchmark:
        benchmark_of("mesh")
    resources:
        mem_mb=lambda wildcards, input, attempt: max(
            700, 400 + 12 * int(input.size_mb)
        )
        * attempt,
        runtime=5,
    params:
        settings=settings_of("mesh"),
        code=stage_digest("mesh"),
        subject=subject_of,
    message:
        "{wildcards.case}: mesh"
    script:
        "../scripts/stage.py"


# Outline of the mammogram; where the breast lay between the plates.
rule pose:
    input:
        unpack(inputs_of("pose")),
    output:
        named("pose"),
    log:
        log_of("pose"),
    benchmark:
        benchmark_of("pose")
    resources:
        mem_mb=lambda wildcards, input, attempt: max(
            1200, 400 + 12 * int(input.size_mb)
        )
        * attempt,
        runtime=10,
    params:
        settings=settings_of("pose"),
        code=stage_digest("pose"),
        subject=subject_of,
    message:
        "{wildcards.case} {wildcards.view}: pose"
    script:
        "../scripts/stage.py"


# The breast between two rigid plates.
rule compress:
    input:
        unpack(inputs_of("compress")),
    output:
        named("compress"),
    log:
        log_of("compress"),
    benchmark:
        benchmark_of("compress")
    resources:
        mem_mb=lambda wildcards, input, attempt: max(
            1200, 400 + 12 * int(input.size_mb)
        )
        * attempt,
        runtime=10,
    params:
        settings=settings_of("compress"),
        code=stage_digest("compress"),
        subject=subject_of,
    message:
        "{wildcards.case} {wildcards.view}: compress"
    script:
        "../scripts/stage.py"


# Surface of the compressed breast that fits the mammogram's outline.
rule shape:
    input:
        unpack(inputs_of("shape")),
    output:
        named("shape"),
    log:
        log_of("shape"),
    benchmark:
        benchmark_of("shape")
    resources:
        mem_mb=lambda wildcards, input, attempt: max(
            900, 400 + 12 * int(input.size_mb)
        )
        * attempt,
        runtime=5,
    params:
        settings=settings_of("shape"),
        code=stage_digest("shape"),
        subject=subject_of,
    message:
        "{wildcards.case} {wildcards.view}: shape"
    script:
        "../scripts/stage.py"


# Interior of the breast under the estimated surface.
rule solve:
    input:
        unpack(inputs_of("solve")),
    output:
        named("solve"),
    log:
        log_of("solve"),
    benchmark:
        benchmark_of("solve")
    resources:
        mem_mb=lambda wildcards, input, attempt: max(
            1200, 400 + 12 * int(input.size_mb)
        )
        * attempt,
        runtime=10,
    params:
        settings=settings_of("solve"),
        code=stage_digest("solve"),
        subject=subject_of,
    message:
        "{wildcards.case} {wildcards.view}: solve"
    script:
        "../scripts/stage.py"


# Projection of the deformed MR volume.
rule project:
    input:
        unpack(inputs_of("project")),
    output:
        named("project"),
    log:
        log_of("project"),
    benchmark:
        benchmark_of("project")
    resources:
        mem_mb=lambda wildcards, input, attempt: max(
            1200, 400 + 12 * int(input.size_mb)
        )
        * attempt,
        runtime=10,
    params:
        settings=settings_of("project"),
        code=stage_digest("project"),
        subject=subject_of,
    message:
        "{wildcards.case} {wildcards.view}: project"
    script:
        "../scripts/stage.py"


# Where each side shows what the other marks.
rule localize:
    input:
        unpack(inputs_of("localize")),
    output:
        named("localize"),
    log:
        log_of("localize"),
    benchmark:
        benchmark_of("localize")
    resources:
        mem_mb=lambda wildcards, input, attempt: max(
            1000, 400 + 12 * int(input.size_mb)
        )
        * attempt,
        runtime=10,
    params:
        settings=settings_of("localize"),
        code=stage_digest("localize"),
        subject=subject_of,
    message:
        "{wildcards.case}: localize"
    script:
        "../scripts/stage.py"


# Predictions against the truth that the tables name.
rule evaluate:
    input:
        unpack(inputs_of("evaluate")),
    output:
        named("evaluate"),
    log:
        log_of("evaluate"),
    benchmark:
        benchmark_of("evaluate")
    resources:
        mem_mb=lambda wildcards, input, attempt: max(
            1000, 400 + 12 * int(input.size_mb)
        )
        * attempt,
        runtime=10,
    params:
        settings=settings_of("evaluate"),
        code=stage_digest("evaluate"),
        subject=subject_of,
    message:
        "{wildcards.case}: evaluate"
    script:
        "../scripts/stage.py"


# Pictures of the case.
rule figures:
    input:
        unpack(inputs_of("figures")),
    output:
        named("figures"),
    log:
        log_of("figures"),
    benchmark:
        benchmark_of("figures")
    resources:
        mem_mb=lambda wildcards, input, attempt: max(
            1200, 400 + 12 * int(input.size_mb)
        )
        * attempt,
        runtime=10,
    params:
        settings=settings_of("figures"),
        code=stage_digest("figures"),
        subject=subject_of,
    message:
        "{wildcards.case}: figures"
    script:
        "../scripts/stage.py"
