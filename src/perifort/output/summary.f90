!> What the user reads on the terminal: what will be computed and why so, and what it came to.
module pd_output_summary
  use pd_base_kinds, only: wp, i8
  use pd_base_clock, only: duration_text
  use pd_base_warnings, only: warnings_type
  use pd_base_text, only: to_text, with_unit, newline
  use pd_scene_types, only: scene_type
  use pd_family_lattice, only: lattice_family_type
  use pd_motion_plan, only: plan_type
  use pd_motion_system, only: system_type
  use pd_output_recorder, only: recorder_type, probe_type
  implicit none (type, external)
  private
  public :: summary_before, summary_after, checkpoint_line, memory_of

contains

  !> The scene as it will be computed: points, bonds, memory, kernels and why, time step, probes.
  function summary_before(scene, system, plan, probes, cut, warnings, threads) result(text)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(plan_type), intent(in) :: plan
    type(probe_type), intent(in) :: probes(:)
    integer(i8), intent(in) :: cut        !! bonds removed by cracks
    type(warnings_type), intent(in) :: warnings  !! found so far
    integer, intent(in) :: threads
    character(:), allocatable :: text
    integer :: p, k

    text = ''
    if (scene%header%title /= '') text = trim(scene%header%title)//newline
    text = text//line('points', to_text(system%body%n_points)//', '// &
      & to_text(scene%header%dimension)//'D, horizon '//with_unit(system%family%rule%delta, 'm'))
    text = text//line('bonds', to_text(system%family%n_bonds)// &
      & ' (each from both ends), at most '//to_text(system%family%most_bonds)//' a point')
    if (size(scene%cracks) > 0) &
      & text = text//line('cracks', to_text(size(scene%cracks))//', which cut '// &
      & to_text(cut)//' bonds')
    text = text//line('memory', with_unit(real(memory_of(system), wp), 'B', 3))
    text = text//kernels(scene, system)
    text = text//line('threads', to_text(threads))
    if (plan%relaxes) then
      text = text//line('relaxation', to_text(plan%relaxation%load_steps)// &
        & ' load step(s), tolerance '//to_text(plan%relaxation%tolerance)//', '// &
        & solver_of(scene))
    else
      text = text//line('time step', with_unit(plan%step, 's', 6)//', '// &
        & to_text(plan%step/plan%limit, 3)//' of the stable '//with_unit(plan%limit, 's', 6)// &
        & ' ('//trim(merge('spectral', '7.25    ', plan%spectral))//', '//plan%integrator//')')
      if (plan%spectral) text = text//line('', 'the largest frequency, measured in '// &
        & to_text(plan%evaluations)//' evaluations, allows '// &
        & to_text(plan%limit/plan%equation, 3)//' of 7.25 ('//with_unit(plan%equation, 's', 6)// &
        & ')'//trim(merge(', whatever breaks', repeat(' ', 17), system%model%breaking)))
      if (scene%time%limit == 'spectral' .and. .not. plan%spectral) text = text//line('', &
        & '7.25, because the largest frequency allows no more here')
      text = text//line('', '7.25 as printed '//printed(plan)//', the book''s estimate '// &
        & with_unit(plan%book, 's', 6))
      text = text//line('steps', to_text(plan%steps)//', to t = '//&
        & with_unit(plan%steps*plan%step, 's', 6))
    end if
    do p = 1, size(probes)
      k = int(probes(p)%slot)
      text = text//line('probe', probes(p)%name//' is point '// &
        & to_text(int(system%body%point(k)))//' at ('//position(system, k)//') m')
    end do
    do p = 1, warnings%count()
      text = text//line('warning', warnings%line(p))
    end do
  end function summary_before

  !> The way to rest.
  pure function solver_of(scene) result(text)
    type(scene_type), intent(in) :: scene
    character(:), allocatable :: text
    text = 'conjugate gradient'
    if (scene%relaxation%solver == 'dynamic_relaxation') &
      & text = 'dynamic relaxation, density matrix '//trim(scene%relaxation%density_matrix)
  end function solver_of

  !> The kernels chosen, each with its reason.
  function kernels(scene, system) result(text)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    character(:), allocatable :: text

    associate (model => system%model)
      text = line('families', system%family%describe())
      if (model%dilatation) then
        text = text//line('kernels', 'dilatation and force pass: some material has a /= 0; '// &
          & trim(scene%horizon%dilatation)//' dilatation')
      else
        text = text//line('kernels', 'force pass only: a = 0 in every material (bond-based)')
      end if
      text = text//line('', trim(merge('surface factors: corrected by energy ', &
        & 'no surface factors: switched off     ', model%surface)))
      if (model%breaking) then
        text = text//line('', 'bonds can break'// &
          & trim(merge(', in compression too', repeat(' ', 20), model%compression)))
      else if (any(scene%materials%critical_stretch > 0.0_wp) .or. &
        & any(scene%materials%critical_energy_release_rate > 0.0_wp)) then
        text = text//line('', 'no bond can break: all points lie in no-fail zones')
      else
        text = text//line('', 'no bond can break: no material has a critical stretch')
      end if
      text = text//line('', trim(merge('thermal strain   ', 'no thermal strain', model%thermal)))
      text = text//line('precision', precision_of(scene, system))
    end associate
  end function kernels

  !> The precision of the bonds, and why it is not the one that was asked for.
  function precision_of(scene, system) result(text)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    character(:), allocatable :: text

    text = 'double'
    select type (family => system%family)
    type is (lattice_family_type)
      if (family%mixed) text = 'mixed: bonds in single precision, state in double'
    end select
    if (text /= 'double' .or. scene%header%precision /= 'mixed') return
    text = text//': mixed is not there for '
    if (scene%header%dimension == 1) then
      text = text//'1D'
    else if (system%model%thermal) then
      text = text//'thermal strain'
    else if (system%model%dilatation .and. .not. system%model%projected) then
      text = text//trim(scene%horizon%dilatation)//' dilatation'
    else
      text = text//'critical stretches this small'
    end if
  end function precision_of

  pure function printed(plan) result(text)
    type(plan_type), intent(in) :: plan
    character(:), allocatable :: text
    text = 'has no value (its sum is negative)'
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
    character(:), allocatable :: text
    real(wp) :: balance, share
    integer :: steps

    text = recorder%timer%table()//newline
    steps = recorder%steps_done - recorder%first_step
    if (steps > 0) text = text//line('speed', &
      & to_text(1.0e9_wp*recorder%timer%seconds('time stepping') &
      & /(real(system%family%n_bonds, wp)*steps), 3)//' ns per bond and step, '// &
      & to_text(steps/max(1.0e-9_wp, recorder%timer%seconds('time stepping')), 4)//' steps/s')
    if (recorder%team%report() /= '') text = text//line('threads', recorder%team%report())
    if (recorder%gave_way > 0) text = text//line('solver', to_text(recorder%gave_way)// &
      & ' load step(s) were left to dynamic relaxation by the conjugate gradient')
    associate (now => recorder%energies)
      text = text//line('kinetic energy', with_unit(now%kinetic, 'J'))
      text = text//line('strain energy', with_unit(now%strain, 'J'))
      if (system%model%breaking) then
        text = text//line('dissipated', with_unit(system%dissipated, 'J')//' by breaking '// &
          & to_text(system%broken)//' bonds')
        text = text//line('damage', 'at most '//to_text(maxval(system%state%damage), 3))
      end if
      text = text//line('external work', with_unit(system%external_work, 'J'))
      call recorder%energy_balance(system, balance, share)
      if (share >= 0.0_wp) text = text//line('energy balance', 'off by '// &
        & with_unit(balance, 'J')//', '//to_text(100*share, 2)//' % of the energy')
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

  !> A labelled line.
  pure function line(label, content) result(text)
    character(*), intent(in) :: label, content
    character(:), allocatable :: text
    character(18) :: column
    column = '  '//label
    text = column//content//newline
  end function line

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

end module pd_output_summary
