!> What the user reads on the terminal: what will be computed and why so, and what it came to.
module pd_output_report_summary
  use pd_base_kinds, only: wp, i8
  use pd_base_clock, only: duration_text
  use pd_base_reduce, only: largest_over
  use pd_base_warnings, only: warnings_type
  use pd_base_text, only: counted, line => labelled_line, newline, to_text, with_unit
  use pd_scene_content_types, only: scene_type
  use pd_family_lattice, only: lattice_family_type
  use pd_set_up_plan, only: plan_type
  use pd_motion_system, only: system_type
  use pd_output_report_recorder, only: recorder_type, probe_type
  implicit none (type, external)
  private
  public :: summary_before, summary_after, checkpoint_line, memory_of

contains

  !> The scene as it will be computed, a fact in each line: points, bonds, memory, forces, time
  !> step, probes, and what is to be noted.
  function summary_before(scene, system, plan, probes, cut, warnings, notes, threads) result(text)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(plan_type), intent(in) :: plan
    type(probe_type), intent(in) :: probes(:)
    integer(i8), intent(in) :: cut        !! bonds removed by cracks
    type(warnings_type), intent(in) :: warnings  !! found so far
    type(warnings_type), intent(in) :: notes     !! what is right and may surprise
    integer, intent(in) :: threads        !! that the run may use
    character(:), allocatable :: text
    integer :: p, k

    text = ''
    if (scene%header%title /= '') text = trim(scene%header%title)//newline
    text = text//line('points', to_text(system%body%n_points)//' in '// &
      & to_text(scene%header%dimension)//'D')
    text = text//line('horizon', with_unit(system%family%rule%delta, 'm')//', '// &
      & to_text(system%family%rule%delta/greatest_spacing(system), 5)//' spacings of '// &
      & with_unit(greatest_spacing(system), 'm', 4))
    text = text//line('bonds', to_text(system%family%n_bonds/2)//' pairs of points ('// &
      & to_text(system%family%n_bonds)//' if both directions count)')
    text = text//line('', 'at most '//to_text(system%family%most_bonds)//' at a point')
    if (size(scene%cracks) > 0) &
      & text = text//line('cracks', to_text(size(scene%cracks))//', which cut the bonds of '// &
      & to_text(cut)//' pairs')
    text = text//line('memory', with_unit(real(memory_of(system), wp), 'B', 3))
    text = text//forces(scene, system)
    text = text//line('threads', to_text(threads))
    if (plan%relaxes) then
      text = text//statics(scene, plan)
    else
      text = text//steps(scene, system, plan)
    end if
    do p = 1, size(probes)
      k = int(probes(p)%slot)
      text = text//line('probe', probes(p)%name//' is point '// &
        & to_text(int(system%body%point(k)))//' at ('//position(system, k)//') m')
    end do
    do p = 1, notes%count()
      text = text//line('note', notes%line(p))
    end do
    do p = 1, warnings%count()
      text = text//line('warning', warnings%line(p))
    end do
  end function summary_before

  !> The largest spacing of all points [m].
  real(wp) function greatest_spacing(system) result(spacing)
    type(system_type), intent(in) :: system
    spacing = largest_over(system%body%order, system%body%spacing)
  end function greatest_spacing

  !> How static equilibrium is found.
  pure function statics(scene, plan) result(text)
    type(scene_type), intent(in) :: scene
    type(plan_type), intent(in) :: plan
    character(:), allocatable :: text

    text = line('relaxation', 'static equilibrium in '// &
      & counted(plan%relaxation%load_steps, 'load step'))
    if (scene%relaxation%solver == 'dynamic_relaxation') then
      text = text//line('solver', 'dynamic relaxation, density matrix '// &
        & trim(scene%relaxation%density_matrix))
    else
      text = text//line('solver', 'conjugate gradient')
    end if
    text = text//line('tolerance', to_text(plan%relaxation%tolerance))
  end function statics

  !> The time step, where its limit is from, and how many there are.
  pure function steps(scene, system, plan) result(text)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(plan_type), intent(in) :: plan
    character(:), allocatable :: text

    text = line('time step', with_unit(plan%step, 's', 6)//', '// &
      & to_text(plan%step/plan%limit, 3)//' of the stable step')
    text = text//line('stable step', with_unit(plan%limit, 's', 6)//' for '//plan%integrator// &
      & trim(merge(', from the largest frequency of the body', ', from equation 7.25'// &
      & repeat(' ', 20), plan%spectral)))
    if (plan%spectral) then
      text = text//line('', 'measured in '//to_text(plan%evaluations)//' evaluations of the forces')
      if (system%model%breaking) text = text//line('', &
        & 'it holds for any state of broken bonds')
      text = text//line('equation 7.25', with_unit(plan%equation, 's', 6)// &
        & '; the stable step is '//to_text(plan%limit/plan%equation, 3)//' times as long')
    else if (scene%time%limit == 'spectral') then
      text = text//line('', 'the largest frequency allows no longer step')
    end if
    text = text//line('7.25 as printed', printed(plan))
    text = text//line('book''s estimate', with_unit(plan%book, 's', 6))
    text = text//line('steps', to_text(plan%steps))
    text = text//line('end time', with_unit(plan%steps*plan%step, 's', 6))
  end function steps

  !> How the forces are computed and why so.
  function forces(scene, system) result(text)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    character(:), allocatable :: text

    associate (model => system%model)
      text = line('families', system%family%describe())
      if (model%dilatation) then
        text = text//line('forces', 'state-based: two passes over the bonds, for the '// &
          & 'dilatations and for the forces')
        text = text//line('dilatation', trim(scene%horizon%dilatation))
      else
        text = text//line('forces', 'bond-based: one pass over the bonds, no dilatation')
      end if
      text = text//line('surfaces', trim(merge('corrected by energy', &
        & 'not corrected      ', model%surface)))
      if (model%breaking) then
        text = text//line('fracture', 'bonds can break'// &
          & trim(merge(' in tension and in compression', repeat(' ', 30), model%compression)))
      else if (any(scene%materials%critical_stretch > 0.0_wp) .or. &
        & any(scene%materials%critical_energy_release_rate > 0.0_wp)) then
        text = text//line('fracture', 'no bond can break: all points lie in no-fail zones')
      else
        text = text//line('fracture', 'no bond can break: no material has a critical stretch')
      end if
      text = text//line('thermal strain', trim(merge('yes', 'no ', model%thermal)))
      text = text//line('precision', precision_of(scene, system))
    end associate
  end function forces

  !> The precision of the bonds, and why it is not the one that was asked for.
  function precision_of(scene, system) result(text)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    character(:), allocatable :: text

    text = 'double'
    select type (family => system%family)
    type is (lattice_family_type)
      if (family%mixed) text = 'mixed: bonds in single precision, state in double'
    class default  ! others have double precision alone
      continue
    end select
    if (text /= 'double' .or. scene%header%precision /= 'mixed') return
    text = text//': mixed precision is not available for '
    if (scene%header%dimension == 1) then
      text = text//'1D'
    else if (system%model%thermal) then
      text = text//'thermal strain'
    else
      text = text//'critical stretches this small'
    end if
  end function precision_of

  pure function printed(plan) result(text)
    type(plan_type), intent(in) :: plan
    character(:), allocatable :: text
    text = 'no value, because its sum is negative'
    if (plan%printed > 0.0_wp) text = with_unit(plan%printed, 's', 6)
  end function printed

  !> How large checkpoints are and how often they are written.
  pure function checkpoint_line(scene, bytes) result(text)
    type(scene_type), intent(in) :: scene
    integer(i8), intent(in) :: bytes
    character(:), allocatable :: text

    text = ''
    if (scene%output%checkpoint_every > 0) &
      & text = 'every '//to_text(scene%output%checkpoint_every)//' steps'
    if (scene%output%checkpoint_minutes > 0.0_wp) then
      if (text /= '') text = text//' and '
      text = text//'every '//duration_text(60*scene%output%checkpoint_minutes)
    end if
    if (text == '') text = 'only when the run is interrupted'
    text = '  checkpoints     '//with_unit(real(bytes, wp), 'B', 3)//', the last two kept, '//text
  end function checkpoint_line

  !> What the run came to: time per phase, speed, energies, damage, where the results are.
  function summary_after(system, recorder, directory) result(text)
    type(system_type), intent(in) :: system
    type(recorder_type), intent(in) :: recorder
    character(*), intent(in) :: directory
    character(:), allocatable :: text, parts
    real(wp) :: balance, share
    integer :: steps

    text = recorder%timer%table()//newline
    steps = recorder%steps_done - recorder%first_step
    if (steps > 0) text = text//line('speed', &
      & to_text(1.0e9_wp*recorder%timer%seconds('time stepping') &
      & /(real(system%family%n_bonds, wp)*steps), 3)//' ns per bond and step, '// &
      & to_text(steps/max(1.0e-9_wp, recorder%timer%seconds('time stepping')), 4)// &
      & trim(merge(' iterations/s', ' steps/s     ', recorder%schedule%relaxation)))
    if (recorder%team%report() /= '') text = text//line('threads', recorder%team%report())
    if (recorder%gave_way > 0) text = text//line('solver', counted(recorder%gave_way, &
      & 'load step')//' left to dynamic relaxation by the conjugate gradient')
    associate (now => recorder%energies)
      text = text//line('kinetic energy', with_unit(now%kinetic, 'J'))
      text = text//line('strain energy', with_unit(now%strain, 'J'))
      if (system%model%breaking) then
        text = text//line('dissipated', with_unit(system%dissipated, 'J'))
        text = text//line('broken bonds', to_text(system%broken)//' pairs of points')
        text = text//line('greatest damage', to_text(largest_over(system%body%order, &
          & system%state%damage), 3))
      end if
      text = text//line('external work', with_unit(system%external_work, 'J'))
      call recorder%energy_balance(system, balance, share)
      if (share >= 0.0_wp) then
        parts = to_text(100*share, 2)//' % of the greater of the energy supplied and the '// &
          & 'energy present'
        if (abs(system%dissipated) > 0.0_wp) parts = parts//', '// &
          & to_text(100*abs(balance/system%dissipated), 2)//' % of the dissipated energy'
        text = text//line('energy balance', 'off by '//with_unit(balance, 'J')//', '//parts)
      end if
    end associate
    if (recorder%warnings%count() > 0) text = text//line('warnings', &
      & to_text(recorder%warnings%count())//', kept in warnings.txt')
    text = text//line('results', directory)
  end function summary_after

  !> Memory of points and families [bytes].
  pure integer(i8) function memory_of(system) result(bytes)
    type(system_type), intent(in) :: system
    integer :: reals
    reals = system%body%dim*4 + 2          ! x, u, v, f; volume, spacing
    if (system%model%dilatation) reals = reals + 1
    if (system%model%breaking) reals = reals + 2  ! damage, s_c
    if (system%model%surface) reals = reals + 2*system%body%dim
    bytes = int(system%body%n_slots, i8)*(8*reals + 20 + system%body%dim) + system%family%bytes()
  end function memory_of

  pure function position(system, k) result(text)
    type(system_type), intent(in) :: system
    integer, intent(in) :: k
    character(:), allocatable :: text
    integer :: c
    text = to_text(system%body%x(k, 1))
    do c = 2, system%body%dim
      text = text//', '//to_text(system%body%x(k, c))
    end do
  end function position

end module pd_output_report_summary
