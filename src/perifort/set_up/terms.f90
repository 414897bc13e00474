!> What acts on a scene's points beside bonds and loads: gravity, springs, absorbing boundaries.
module pd_set_up_terms
  use pd_base_kinds, only: wp
  use pd_base_reduce, only: largest_of_ranks
  use pd_body_body, only: body_type
  use pd_body_waves, only: longitudinal_speed, shear_speed
  use pd_family_volume, only: volume_rule_type
  use pd_force_contact, only: contact_type, new_contact
  use pd_force_contact_law, only: contact_rule_type, of_friction, of_normal_force
  use pd_force_dashpots, only: new_dashpots
  use pd_force_springs, only: new_springs
  use pd_force_terms, only: term_list_type
  use pd_law_material, only: material_type
  use pd_motion_conditions, only: motion_type
  use pd_motion_loads, only: load_of, load_type
  use pd_motion_curve, only: constant_curve, ramp
  use pd_scene_content_types, only: is_set, scene_type
  use pd_set_up_loads, only: volume_of
  use pd_set_up_rigid_bodies, only: add_touches
  implicit none (type, external)
  private
  public :: gravity_of_scene, add_springs_of_scene, add_dashpots_of_scene, leave_uncorrected
  public :: add_contacts_of_scene, sides_of_contact

contains

  !> The weight of all points, layers included, as one load; none without `gravity`. In relaxation
  !> it grows over the load steps.
  subroutine gravity_of_scene(scene, body, materials, loads)
    type(scene_type), intent(in) :: scene            !! a checked scene
    type(body_type), intent(in) :: body              !! its points, arranged in slots
    type(material_type), intent(in) :: materials(:)  !! (any number) by the numbers that points have
    type(load_type), allocatable, intent(out) :: loads(:)  !! (0 or 1)
    integer :: c

    allocate (loads(merge(1, 0, any(is_set(scene%header%gravity)))))
    if (size(loads) == 0) return
    associate (load => loads(1), gravity => scene%header%gravity)
      load%slots = body%slot
      allocate (load%density(size(load%slots), body%dim))
      do c = 1, body%dim
        load%density(:, c) = materials(body%material(load%slots))%density*gravity(c)
      end do
      load%curve = constant_curve()
      if (scene%time%method == 'relaxation') load%curve = ramp(1.0_wp)
    end associate
  end subroutine gravity_of_scene

  !> Springs of every `&load` with a stiffness, shared out among its points by volume.
  subroutine add_springs_of_scene(scene, body, terms)
    type(scene_type), intent(in) :: scene         !! a checked scene
    type(body_type), intent(in) :: body           !! its points, arranged in slots
    type(term_list_type), intent(inout) :: terms  !! with the loads of the scene first
    type(load_type), pointer :: load
    integer :: l

    do l = 1, size(scene%loads)
      associate (group => scene%loads(l))
        if (.not. any(is_set(group%stiffness))) cycle
        load => load_of(terms, l)
        call terms%add(new_springs(load%slots, &
          & group%stiffness(:body%dim)/volume_of(body, load%slots)))
      end associate
    end do
  end subroutine add_springs_of_scene

  !> Dashpots in the layer of every absorbing `&boundary` (doc/theory.md, 10): per area of the side
  !> rho c_p along its normal, rho c_s across it. Of the n rows of a layer the two act that are next
  !> to a distance of 0.2 (n - 2) (1 + (n - 3)/6) rows from the outermost one: there the mass of
  !> what lies beyond balances the softness of the incomplete families.
  subroutine add_dashpots_of_scene(scene, body, materials, motions, terms)
    type(scene_type), intent(in) :: scene            !! a checked scene
    type(body_type), intent(in) :: body              !! its points, arranged in slots
    type(material_type), intent(in) :: materials(:)  !! (any number) by the numbers that points have
    type(motion_type), intent(in) :: motions(:)      !! (boundaries) with the slots of the layers
    type(term_list_type), intent(inout) :: terms     !! with the dashpots on return
    real(wp), allocatable :: damping(:, :)
    real(wp) :: direction, row, width, outermost
    integer :: m, i, c, k, axis, rows

    do m = 1, size(scene%boundaries)
      if (.not. scene%boundaries(m)%absorbing) cycle
      associate (slots => motions(m)%slots, side => scene%boundaries(m)%side)
        axis = index('xyz', side(1:1))
        direction = merge(-1.0_wp, 1.0_wp, side(3:5) == 'min')
        allocate (damping(size(slots), body%dim))
        outermost = largest_of_ranks(body%order, maxval(direction*body%x(slots, axis)))
        width = outermost + largest_of_ranks(body%order, maxval(-direction*body%x(slots, axis)))
        do i = 1, size(slots)
          k = slots(i)
          rows = nint(width/body%spacing(k)) + 1
          row = (outermost - direction*body%x(k, axis))/body%spacing(k)
          associate (material => materials(body%material(k)))
            do c = 1, body%dim
              damping(i, c) = share(row, rows)*material%density/body%spacing(k) &
                & *merge(longitudinal_speed(material), shear_speed(material), c == axis)
            end do
          end associate
        end do
        call terms%add(new_dashpots(slots, damping))
        deallocate (damping)
      end associate
    end do
  end subroutine add_dashpots_of_scene

  !> The part of the dashpots in a row; the rows of a column add up to 1.
  pure real(wp) function share(row, rows)
    real(wp), intent(in) :: row   !! rows from the outermost one [-]
    integer, intent(in) :: rows   !! of the layer

    share = max(0.0_wp, 1 - abs(row - min(0.2_wp*max(0, rows - 2)*(1 + (rows - 3)/6.0_wp), &
      & rows - 1.0_wp)))
  end function share

  !> On which side of a `&contact` each body is: bodies of different sides are never bonded; 0 where
  !> it is not named. With 'all' every body is of one side; a body that is named beside a rigid one
  !> alone meets no other, and is of none.
  function sides_of_contact(scene, number) result(side)
    type(scene_type), intent(in) :: scene  !! a checked scene
    integer, intent(in) :: number          !! of the `&contact`
    integer, allocatable :: side(:)        !! (bodies)
    integer :: b

    allocate (side(size(scene%bodies)), source=0)
    associate (contact => scene%contacts(number))
      do b = 1, size(side)
        if (contact%within /= '') then
          side(b) = merge(1, 0, scene%bodies(b)%name == contact%within)
        else if (contact%between(1) == 'all') then
          side(b) = 1
        else
          side(b) = findloc(contact%between, scene%bodies(b)%name, dim=1)
        end if
      end do
      if (size(contact%between) > 1 .and. count(side > 0) < 2) side = 0
    end associate
  end function sides_of_contact

  !> Every `&contact`: a term for the force along the line between points and, with friction, one
  !> for that across it, so that each has its account.
  subroutine add_contacts_of_scene(scene, body, rule_of_bonds, breakable, terms)
    type(scene_type), intent(in) :: scene         !! a checked scene
    type(body_type), intent(in) :: body           !! its points, arranged in slots
    type(volume_rule_type), intent(in) :: rule_of_bonds  !! with the horizons of the points
    logical, intent(in) :: breakable              !! bonds may break
    type(term_list_type), intent(inout) :: terms  !! with the contacts on return
    type(contact_rule_type) :: rule
    type(contact_type) :: contact
    integer :: i

    do i = 1, size(scene%contacts)
      associate (group => scene%contacts(i))
        rule%side = sides_of_contact(scene, i)
        rule%pieces = maxval(rule%side) == 1
        rule%stiffness = group%stiffness
        rule%distance = 0.0_wp
        if (is_set(group%distance)) rule%distance = group%distance
        rule%friction = group%friction
        rule%smoothed = group%normals == 'smoothed'
        rule%returned = 1.0_wp
        if (is_set(group%restitution)) rule%returned = group%restitution**2
        rule%damping = 0.0_wp
        if (is_set(group%damping)) rule%damping = group%damping
        if (size(scene%rigids) > 0) call add_touches(scene, i, body, &
          & rule_of_bonds, rule, terms)
        if (all(rule%side == 0)) cycle
        call new_contact(body, rule_of_bonds%delta, rule_of_bonds%ratio, rule, of_normal_force, &
          & contact)
        ! the account has the energy by which normals jump when bonds break
        if (contact%law%smoothed .and. breakable) contact%conservative = .false.
        call terms%add(contact)
        if (.not. rule%friction > 0.0_wp) cycle
        call new_contact(body, rule_of_bonds%delta, rule_of_bonds%ratio, rule, of_friction, &
          & contact)
        contact%follows = .true.
        call terms%add(contact)
      end associate
    end do
  end subroutine add_contacts_of_scene

  !> Take the surface correction from the points of absorbing layers, whose softness their mass
  !> balances.
  pure subroutine leave_uncorrected(scene, motions, D, S)
    type(scene_type), intent(in) :: scene         !! a checked scene
    type(motion_type), intent(in) :: motions(:)   !! (boundaries) with the slots of the layers
    real(wp), intent(inout) :: D(:, :), S(:, :)   !! (n_slots, dim) surface factors [-]
    integer :: m

    do m = 1, size(scene%boundaries)
      if (.not. scene%boundaries(m)%absorbing) cycle
      D(motions(m)%slots, :) = 1.0_wp
      S(motions(m)%slots, :) = 1.0_wp
    end do
  end subroutine leave_uncorrected

end module pd_set_up_terms
