!> Which closed forms a scene has, with the numbers that the scene gives them.
!>
!> A form fits or is refused with the reason: it must be the solution of this scene.
module pd_study_trade_analytic
  use pd_base_kinds, only: wp
  use pd_base_error, only: internal_fault
  use pd_base_numbers, only: pi
  use pd_base_text, only: newline, to_text
  use pd_body_generate, only: horizon_of
  use pd_law_laws, only: law_table_type
  use pd_law_weighted, only: weighted_law_type
  use pd_family_volume, only: reach, volume_correction, volume_rule_number, volume_rule_type
  use pd_motion_system, only: system_type
  use pd_scene_content_expressions, only: has_expressions
  use pd_scene_content_groups, only: closed_forms
  use pd_scene_content_types, only: boundary_group, has_refinement, initial_group, is_box, is_set, &
    & laws_of, scene_type, shape_group
  use pd_study_trade_closed_form, only: chain_frequency, closed_form_type, form_chain, form_hole, &
    & form_linear, form_wave
  use pd_study_trade_pull, only: pull
  implicit none (type, external)
  private
  public :: find_form, complete_form

  real(wp), parameter :: tolerance = 1.0e-9_wp      !! of equality [-]
  real(wp), parameter :: pure_wave = 1.0e-6_wp !! part of a state that may be of other wave numbers

contains

  !> The closed form `name` for a scene; with '' the first that fits. `reason` is '' if there is
  !> one, else why not.
  subroutine find_form(name, scene, form, reason)
    character(*), intent(in) :: name  !! of the closed form; '' for the first that fits
    type(scene_type), intent(in) :: scene             !! with its groups as they were read
    type(closed_form_type), intent(out) :: form       !! with kind and numbers if it fits, else
                                                      !! without meaning
    character(:), allocatable, intent(out) :: reason  !! why no form fits; '' if one does
    character(:), allocatable :: why
    integer :: i

    if (name /= '') then
      call fit(name, scene, form, reason)
      if (len(reason) > 0) reason = "the closed form '"//name//"' does not fit: "//reason
      return
    end if
    reason = 'no closed form fits the scene:'
    do i = 1, size(closed_forms)
      call fit(trim(closed_forms(i)), scene, form, why)
      if (len(why) == 0) then
        reason = ''
        return
      end if
      reason = reason//newline//'  '//closed_forms(i)//' '//why
    end do
  end subroutine find_form

  !> One form. `reason` is '' if it fits.
  subroutine fit(name, scene, form, reason)
    character(*), intent(in) :: name
    type(scene_type), intent(in) :: scene
    type(closed_form_type), intent(inout) :: form
    character(:), allocatable, intent(out) :: reason
    real(wp) :: nu

    call common_ground(scene, reason)
    if (len(reason) > 0) return
    form = closed_form_type()
    form%name = name
    form%dim = scene%header%dimension
    form%modulus = scene%materials(1)%youngs_modulus
    nu = scene%materials(1)%poissons_ratio
    form%ratio = nu
    if (form%dim == 1) form%ratio = 0.0_wp
    if (form%dim == 2 .and. scene%header%plane == 'strain') then
      form%modulus = form%modulus/(1 - nu**2)
      form%ratio = nu/(1 - nu)
      form%across = nu
    end if
    select case (name)
    case ('bar_vibration')
      call fit_vibration(scene, form, reason)
    case ('bar_tension')
      if (form%dim /= 1) reason = 'it is for dimension 1; for plates and blocks uniaxial_stress'
      if (len(reason) == 0) call fit_tension(scene, form, reason)
    case ('uniaxial_stress')
      if (form%dim == 1) reason = 'it is for dimension 2 and 3; for bars bar_tension'
      if (len(reason) == 0) call fit_tension(scene, form, reason)
    case ('plate_hole')
      call fit_hole(scene, form, reason)
    case ('chain_wave')
      call fit_chain(scene, form, reason)
    case ('linear_field')
      call fit_linear(scene, form, reason)
    case default
      call internal_fault('fit does not know a closed form of closed_forms')
    end select
  end subroutine fit

  !> What all forms need: one lattice body of one material, whole, at one temperature.
  subroutine common_ground(scene, reason)
    type(scene_type), intent(in) :: scene
    character(:), allocatable, intent(out) :: reason
    integer :: i

    reason = ''
    if (size(scene%bodies) /= 1) then
      reason = 'it needs a single body'
    else if (.not. is_box(scene%bodies(1))) then
      reason = 'it needs a lattice that fills a box'
    else if (size(scene%kept) > 0) then
      reason = 'the scene has a &keep'
    else if (size(scene%materials) /= 1) then
      reason = 'it needs a single material'
    else if (has_history(scene)) then
      reason = 'it is for an elastic bond law'
    else if (size(scene%cracks) > 0) then
      reason = 'the scene has a crack'
    else if (has_expressions(scene)) then
      reason = 'an initial value, a boundary or a load is an expression'
    else if (any(is_set(scene%initial%temperature_change))) then
      reason = 'the scene has a temperature change'
    else if (any(is_set(scene%header%gravity))) then
      reason = 'the scene has gravity'
    else if (any(scene%boundaries%absorbing)) then
      reason = 'the scene has an absorbing boundary'
    else if (any(scene%boundaries%motion == 'pin')) then
      reason = 'a boundary is a pin'
    end if
    do i = 1, size(scene%loads)
      if (allocated(scene%loads(i)%times)) reason = 'a load has its own times'
      if (any(is_set(scene%loads(i)%stiffness))) reason = 'a &load has springs'
    end do
    do i = 1, size(scene%boundaries)
      if (allocated(scene%boundaries(i)%times)) reason = 'a boundary has its own times'
    end do
  end subroutine common_ground

  !> Whether the law of the first material has a history.
  logical function has_history(scene)
    type(scene_type), intent(in) :: scene
    type(law_table_type) :: laws
    integer :: n

    laws = laws_of(scene)
    n = laws%number_of(scene%materials(1)%model)
    has_history = .false.
    if (n > 0) has_history = laws%items(n)%law%bond_history + laws%items(n)%law%point_history > 0
  end function has_history

  !> Whether the law of the first material is one of the chapter's, with its influence function.
  logical function has_chapters_law(scene)
    type(scene_type), intent(in) :: scene
    type(law_table_type) :: laws
    integer :: n

    has_chapters_law = .false.
    laws = laws_of(scene)
    n = laws%number_of(scene%materials(1)%model)
    if (n == 0) return
    if (scene%materials(1)%influence /= '') laws%items(n)%law%influence = &
      & scene%materials(1)%influence
    select type (law => laws%items(n)%law)
    class is (weighted_law_type)
      has_chapters_law = .not. law%has_factors()
    class default  ! a law with a force of its own
      continue
    end select
  end function has_chapters_law

  !> A bar released from uniform strain, held at one end.
  subroutine fit_vibration(scene, form, reason)
    type(scene_type), intent(in) :: scene
    type(closed_form_type), intent(inout) :: form
    character(:), allocatable, intent(inout) :: reason
    real(wp) :: slope, shift
    integer :: end

    if (form%dim /= 1) then
      reason = 'it is for dimension 1'
    else if (scene%time%method /= 'explicit') then
      reason = "it needs &time method = 'explicit'"
    else if (size(scene%loads) > 0 .or. size(scene%removed) > 0) then
      reason = 'the bar must be free of removed shapes and of loads'
    else if (size(scene%boundaries) /= 1) then
      reason = 'one end must be held by a &boundary with a side'
    else if (scene%boundaries(1)%side == '' .or. .not. rests(scene%boundaries(1), 1)) then
      reason = 'the &boundary must hold a side with displacement_x = 0'
    else
      call uniform_start(scene, slope, shift, reason)
    end if
    if (len(reason) > 0) return
    end = merge(1, 2, scene%boundaries(1)%side == 'x_min')
    form%kind = form_wave
    associate (low => scene%bodies(1)%lower(1), high => scene%bodies(1)%upper(1))
      form%length = high - low
      form%origin(1) = merge(low, high, end == 1)
      form%side = merge(1.0_wp, -1.0_wp, end == 1)
    end associate
    form%gradient(1, 1) = slope
    form%speed = sqrt(form%modulus/scene%materials(1)%density)
    if (abs(slope) <= 0.0_wp) then
      reason = 'the scene starts without strain; give &initial displacement_gradient(1,1)'
    else if (abs(slope*form%origin(1) + shift) > tolerance*abs(slope)*form%length) then
      reason = 'the initial displacement is not 0 at the held end'
    end if
  end subroutine fit_vibration

  !> The initial displacement u = slope x + shift of a bar without velocity.
  subroutine uniform_start(scene, slope, shift, reason)
    type(scene_type), intent(in) :: scene
    real(wp), intent(out) :: slope, shift
    character(:), allocatable, intent(inout) :: reason
    integer :: i

    slope = 0.0_wp
    shift = 0.0_wp
    do i = 1, size(scene%initial)
      associate (initial => scene%initial(i))
        if (initial%region /= '' .or. initial%file /= '') &
          & reason = 'the initial state must be that of all points, by displacement_gradient'
        if (any(is_set(initial%velocity) .and. abs(initial%velocity) > 0.0_wp) .or. &
          & any(abs(initial%velocity_gradient) > 0.0_wp)) reason = 'the initial velocity must be 0'
        if (.not. sets(initial, 1)) cycle
        slope = initial%displacement_gradient(1, 1)
        shift = merge(initial%displacement(1), 0.0_wp, is_set(initial%displacement(1)))
      end associate
    end do
  end subroutine uniform_start

  !> A bar, plate or block under uniaxial stress: pulled or held at two opposite sides.
  subroutine fit_tension(scene, form, reason)
    type(scene_type), intent(in) :: scene
    type(closed_form_type), intent(inout) :: form
    character(:), allocatable, intent(inout) :: reason
    integer :: axis
    real(wp) :: strain

    if (size(scene%removed) > 0) then
      reason = 'a shape is cut out of the body'
      return
    end if
    call pull(scene, form, axis, strain, reason)
    if (len(reason) > 0) return
    form%kind = form_linear
    call set_uniaxial(form, axis, strain)
  end subroutine fit_tension

  !> Strain along `axis`, and across it by Poisson's ratio.
  pure subroutine set_uniaxial(form, axis, strain)
    type(closed_form_type), intent(inout) :: form
    integer, intent(in) :: axis
    real(wp), intent(in) :: strain
    integer :: c

    do c = 1, form%dim
      form%gradient(c, c) = merge(strain, -form%ratio*strain, c == axis)
    end do
  end subroutine set_uniaxial

  !> A round hole in the middle of a plate that is pulled at two opposite sides, alike.
  subroutine fit_hole(scene, form, reason)
    type(scene_type), intent(in) :: scene
    type(closed_form_type), intent(inout) :: form
    character(:), allocatable, intent(inout) :: reason
    real(wp) :: strain, centre(2), size_of_plate
    integer :: axis

    if (form%dim /= 2) then
      reason = 'it is for dimension 2'
    else if (size(scene%removed) /= 1) then
      reason = 'one &remove must cut the hole'
    else if (.not. is_round(scene%removed(1))) then
      reason = 'the hole must be round'
    end if
    if (len(reason) > 0) return
    call pull(scene, form, axis, strain, reason)
    if (len(reason) > 0) return
    centre = (scene%bodies(1)%lower(:2) + scene%bodies(1)%upper(:2))/2
    size_of_plate = maxval(scene%bodies(1)%upper(:2) - scene%bodies(1)%lower(:2))
    if (any(abs(form%origin(:2) - centre) > tolerance*size_of_plate) .or. &
      & any(abs(form%shift(:2)) > tolerance*abs(strain)*size_of_plate)) then
      reason = 'the plate must be pulled at both sides alike'
    else if (any(abs(scene%removed(1)%centre(:2) - centre) > tolerance*size_of_plate)) then
      reason = 'the hole must be in the middle of the plate'
    end if
    form%kind = form_hole
    form%axis = axis
    form%radius = scene%removed(1)%radius
    form%stress = form%modulus*strain
  end subroutine fit_hole

  !> Whether a shape cuts a round hole out of a plate.
  pure logical function is_round(shape)
    type(shape_group), intent(in) :: shape
    is_round = shape%shape == 'sphere' .or. (shape%shape == 'cylinder' .and. shape%axis == 'z' &
      & .and. .not. any(is_set([shape%direction, shape%height])))
    is_round = is_round .and. shape%region == '' .and. shape%where == ''
  end function is_round

  !> A bar without ends that matter, started with one wave number from a table.
  subroutine fit_chain(scene, form, reason)
    type(scene_type), intent(in) :: scene
    type(closed_form_type), intent(inout) :: form
    character(:), allocatable, intent(inout) :: reason

    if (form%dim /= 1) then
      reason = 'it is for dimension 1'
    else if (.not. has_chapters_law(scene)) then
      reason = "it is for the chapter's laws with influence = 'inverse'"
    else if (scene%time%method /= 'explicit') then
      reason = "it needs &time method = 'explicit'"
    else if (size(scene%loads) + size(scene%boundaries) + size(scene%removed) > 0) then
      reason = 'the chain must be without loads and boundaries, and without removed shapes'
    else if (has_refinement(scene)) then
      reason = 'the chain must have one spacing'
    else if (size(scene%initial) /= 1) then
      reason = 'one &initial must give the wave'
    else if (scene%initial(1)%file == '' .or. scene%initial(1)%region /= '') then
      reason = 'the wave must come from a file of &initial for all points'
    end if
    form%kind = form_chain
  end subroutine fit_chain

  !> A uniform gradient that velocities of 0 hold somewhere.
  subroutine fit_linear(scene, form, reason)
    type(scene_type), intent(in) :: scene
    type(closed_form_type), intent(inout) :: form
    character(:), allocatable, intent(inout) :: reason
    integer :: i, c

    form%kind = form_linear
    if (size(scene%loads) + size(scene%removed) > 0) &
      & reason = 'the body must have no removed shapes and no loads'
    if (size(scene%initial) == 0) reason = 'no &initial gives a displacement_gradient'
    do i = 1, size(scene%initial)
      associate (initial => scene%initial(i))
        if (initial%region /= '' .or. initial%file /= '') &
          & reason = 'the initial state must be that of all points, by displacement_gradient'
        if (any(is_set(initial%velocity) .and. abs(initial%velocity) > 0.0_wp) .or. &
          & any(abs(initial%velocity_gradient) > 0.0_wp)) reason = 'the initial velocity must be 0'
        do c = 1, form%dim
          if (.not. sets(initial, c)) cycle
          form%gradient(c, :) = initial%displacement_gradient(c, :)
          form%shift(c) = merge(initial%displacement(c), 0.0_wp, is_set(initial%displacement(c)))
        end do
      end associate
    end do
    if (size(scene%boundaries) == 0) reason = 'no &boundary holds the field with velocities of 0'
    do i = 1, size(scene%boundaries)
      do c = 1, form%dim
        if (.not. stays(scene%boundaries(i), c)) &
          & reason = 'every &boundary must hold all directions with velocities of 0'
      end do
    end do
  end subroutine fit_linear

  !> Data that follow from the points and their state: the wave number of a chain, and how far from
  !> its ends they are not felt until `time` [s]. `reason` is '' if the form holds.
  subroutine complete_form(scene, system, time, form, reason)
    type(scene_type), intent(in) :: scene             !! with its groups as they were read
    type(system_type), intent(in) :: system           !! at the start of the run
    real(wp), intent(in) :: time                      !! until which the form is to hold [s]
    type(closed_form_type), intent(inout) :: form     !! as `find_form` left it; a chain gets
                                                      !! spacing, state, frequency and limits
    character(:), allocatable, intent(out) :: reason  !! why the form does not hold; '' if it does
    real(wp), parameter :: lead = 20.0_wp   ! horizons that the front runs ahead of the energy
    type(volume_rule_type) :: rule
    real(wp), allocatable :: fraction(:)
    real(wp) :: k, factor, fastest, wave_number, step
    integer :: j, m

    reason = ''
    if (form%kind /= form_chain) return
    associate (body => system%body)
      form%spacing = body%spacing(body%slot(1))
      form%u = system%state%u(body%slot, 1)
      form%v = system%state%v(body%slot, 1)
    end associate
    form%origin(1) = scene%bodies(1)%lower(1)
    call wave_number_of(form, k, reason)
    if (len(reason) > 0) return
    rule = volume_rule_type(volume_rule_number(trim(scene%horizon%volume_correction)), &
      & horizon_of(scene, form%spacing))
    m = int(reach(rule, form%spacing, 1)/form%spacing)
    fraction = [(volume_correction(rule, [j*form%spacing], j*form%spacing, form%spacing), j=1, m)]
    if (scene%horizon%surface_correction == 'consistent') then
      reason = "the closed form 'chain_wave' does not fit: it knows no consistent weights; "// &
        & "give surface_correction = 'energy' or 'none'"
      return
    end if
    ! away from the ends the correction by energy makes the sum over a family exact
    factor = 1.0_wp
    if (scene%horizon%surface_correction == 'energy') factor = (rule%delta/form%spacing)**2 &
      & /(2*sum([(j*fraction(j), j=1, m)]))
    associate (e => factor*form%modulus, rho => scene%materials(1)%density, h => form%spacing)
      form%frequency = chain_frequency(k, h, rule%delta, e, rho, fraction)
      fastest = 0.0_wp
      step = pi/h/1000
      do j = 1, 1000
        wave_number = (j - 0.5_wp)*step
        fastest = max(fastest, abs(chain_frequency(wave_number + step/2, h, rule%delta, e, rho, &
          & fraction) - chain_frequency(wave_number - step/2, h, rule%delta, e, rho, fraction)) &
          & /step)
      end do
    end associate
    form%lower = scene%bodies(1)%lower(1) + fastest*time + lead*rule%delta
    form%upper = scene%bodies(1)%upper(1) - fastest*time - lead*rule%delta
    if (form%lower >= form%upper) reason = "the closed form 'chain_wave' does not fit: until t = " &
      & //to_text(time)//' s waves from the ends reach every point; make the chain longer by '// &
      & to_text(form%lower - form%upper)//' m, or end sooner'
  end subroutine complete_form

  !> The wave number: neighbours of a pure wave obey u(j+1) + u(j-1) = 2 cos(k h) u(j).
  subroutine wave_number_of(form, k, reason)
    type(closed_form_type), intent(in) :: form
    real(wp), intent(out) :: k
    character(:), allocatable, intent(inout) :: reason
    real(wp) :: both, square, cosine, rest
    integer :: n

    n = size(form%u)
    k = 0.0_wp
    reason = "the closed form 'chain_wave' does not fit: "
    if (n < 3 .or. all(abs(form%u) <= 0.0_wp) .and. all(abs(form%v) <= 0.0_wp)) then
      reason = reason//'the values of the file are not a wave'
      return
    end if
    ! displacements and velocities in units of their own
    both = 0.0_wp
    square = 0.0_wp
    call add(form%u)
    call add(form%v)
    cosine = both/(2*square)
    rest = max(misfit(form%u), misfit(form%v))
    if (abs(cosine) >= 1.0_wp .or. rest > pure_wave*2*(1 - abs(min(cosine, 1.0_wp)))) then
      reason = reason//'the initial state is not a wave of a single wave number'
      return
    end if
    k = acos(cosine)/form%spacing
    reason = ''

  contains

    subroutine add(values)
      real(wp), intent(in) :: values(:)
      real(wp) :: unit
      unit = maxval(abs(values))
      if (unit <= 0.0_wp) return
      both = both + sum(values(2:n - 1)/unit*(values(3:) + values(:n - 2))/unit)
      square = square + sum((values(2:n - 1)/unit)**2)
    end subroutine add

    real(wp) function misfit(values)
      real(wp), intent(in) :: values(:)
      misfit = 0.0_wp
      if (maxval(abs(values)) > 0.0_wp) misfit = maxval(abs(values(3:) + values(:n - 2) &
        & - 2*cosine*values(2:n - 1)))/maxval(abs(values))
    end function misfit
  end subroutine wave_number_of

  !> Whether a group sets the displacement along `c`, in place of what groups before it have set.
  pure logical function sets(initial, c)
    type(initial_group), intent(in) :: initial
    integer, intent(in) :: c
    sets = is_set(initial%displacement(c)) .or. &
      & any(abs(initial%displacement_gradient(c, :)) > 0.0_wp)
  end function sets

  !> Whether a boundary holds direction `c` at a displacement of 0.
  pure logical function rests(boundary, c)
    type(boundary_group), intent(in) :: boundary
    integer, intent(in) :: c
    rests = .false.
    if (is_set(boundary%displacement(c))) rests = abs(boundary%displacement(c)) <= 0.0_wp
  end function rests

  !> Whether a boundary holds direction `c` where it is at the start.
  pure logical function stays(boundary, c)
    type(boundary_group), intent(in) :: boundary
    integer, intent(in) :: c
    stays = .false.
    if (is_set(boundary%velocity(c))) stays = abs(boundary%velocity(c)) <= 0.0_wp
  end function stays

end module pd_study_trade_analytic
