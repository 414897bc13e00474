!> What is known of a run's output before its first step: probes, whether the schedule fits the
!> run, warnings and notes.
module pd_output_report_before
  use pd_base_kinds, only: wp
  use pd_base_error, only: error_type
  use pd_body_body, only: body_type
  use pd_body_generate, only: touch
  use pd_output_report_begin, only: check_schedule
  use pd_output_report_recorder, only: probe_type, field_of
  use pd_output_report_warnings, only: note_before, warn_before
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: set_up_type
  implicit none (type, external)
  private
  public :: foresee_output, find_probes

contains

  !> Check the schedule of the output, find the probes, and add warnings and notes to the set-up.
  subroutine foresee_output(scene, set_up, probes, error)
    type(scene_type), intent(in) :: scene
    type(set_up_type), intent(inout) :: set_up         !! of the scene; gets warnings and notes
    type(probe_type), allocatable, intent(out) :: probes(:)  !! one for each of the scene
    type(error_type), allocatable, intent(out) :: error

    associate (system => set_up%system, plan => set_up%plan)
      call check_schedule(scene, plan, system%family%n_bonds, error)
      if (allocated(error)) return
      call find_probes(scene, system%body, probes)
      call warn_before(scene, system, plan, probes, set_up%isolated, set_up%warnings)
      call note_before(scene, system, set_up%notes)
    end associate
  end subroutine foresee_output

  !> The nearest point of each probe; ties go to the lowest point number.
  subroutine find_probes(scene, body, probes)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    type(probe_type), allocatable, intent(out) :: probes(:)
    real(wp) :: distance, least
    integer :: p, i, f

    allocate (probes(size(scene%probes)))
    do p = 1, size(probes)
      probes(p)%name = trim(scene%probes(p)%name)
      least = huge(least)
      do i = 1, body%n_points
        distance = norm2(body%x(body%slot(i), :) - scene%probes(p)%point(:body%dim))
        ! a hair's breadth nearer is no nearer: ties must not depend on rounding
        if (distance >= least - touch*body%spacing(body%slot(i))) cycle
        least = distance
        probes(p)%slot = body%slot(i)
      end do
      allocate (probes(p)%fields(size(scene%probes(p)%fields)))
      do f = 1, size(probes(p)%fields)
        probes(p)%fields(f) = field_of(trim(scene%probes(p)%fields(f)))
      end do
    end do
  end subroutine find_probes

end module pd_output_report_before
