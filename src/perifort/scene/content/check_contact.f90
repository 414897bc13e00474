!> Rules for contact.
module pd_scene_content_check_contact
  use pd_base_error, only: error_type
  use pd_scene_content_rules, only: check_known, rule_fault
  use pd_scene_content_types, only: is_set, name_length, scene_type
  use pd_scene_format_source, only: source_type
  implicit none (type, external)
  private
  public :: check_contact

contains

  !> One `&contact`: who meets whom, by known names, and at most one way to lose energy.
  subroutine check_contact(scene, number, error, source)
    type(scene_type), intent(inout) :: scene           !! its lists are allocated
    integer, intent(in) :: number                      !! which group of this name
    type(error_type), allocatable, intent(out) :: error
    type(source_type), intent(in), optional :: source  !! the scanned file, for places
    character(name_length), allocatable :: bodies(:)
    integer :: i

    associate (contact => scene%contacts(number))
      if (.not. allocated(contact%between)) allocate (contact%between(0))
      allocate (bodies(size(scene%bodies) + size(scene%rigids)))
      bodies(:size(scene%bodies)) = scene%bodies%name
      bodies(size(scene%bodies) + 1:) = scene%rigids%name
      if (scene%time%method == 'relaxation') then
        call rule_fault(error, 'contact', number, '', '&contact is not for relaxation', &
          & "contact begins and ends, so that the forces have no tangent: use &time method = "// &
          & "'explicit'", source)
      else if (size(contact%between) == 0 .and. contact%within == '') then
        call rule_fault(error, 'contact', number, '', "group &contact lacks the key 'between' "// &
          & "or 'within'", 'expected the names of bodies', source)
      else if (size(contact%between) > 0 .and. contact%within /= '') then
        call rule_fault(error, 'contact', number, 'within', "'between' and 'within' are both "// &
          & 'given', 'write a group for each', source)
      else if (is_set(contact%restitution) .and. is_set(contact%damping)) then
        call rule_fault(error, 'contact', number, 'damping', "'restitution' and 'damping' are "// &
          & 'both given', 'give one of them, or none', source)
      else if (size(contact%between) == 1) then
        if (contact%between(1) /= 'all') call rule_fault(error, 'contact', number, 'between', &
          & "'between' has one name", "expected two bodies or more, or 'all'", source)
      else if (any(contact%between == 'all')) then
        call rule_fault(error, 'contact', number, 'between', "'all' beside other names", &
          & "expected 'all' alone", source)
      end if
      if (allocated(error)) return
      call check_known(contact%within, bodies(:size(scene%bodies)), 'body', 'contact', number, &
        & 'within', error, source)
      do i = 1, size(contact%between)
        if (allocated(error)) return
        if (contact%between(i) /= 'all') call check_known(contact%between(i), bodies, 'body', &
          & 'contact', number, 'between', error, source)
      end do
      if (allocated(error)) return
      call check_rigid_ones()
    end associate

  contains

    !> One rigid body at most, and a body that touches it.
    subroutine check_rigid_ones()
      character(:), allocatable :: first
      integer :: i, rigid

      rigid = 0
      first = ''
      do i = 1, size(scene%contacts(number)%between)
        associate (name => scene%contacts(number)%between(i))
          if (all(scene%rigids%name /= name)) cycle
          rigid = rigid + 1
          if (rigid == 1) first = trim(name)
          if (rigid == 2) call rule_fault(error, 'contact', number, 'between', "'"//first// &
            & "' and '"//trim(name)//"' are both rigid", 'rigid bodies do not touch each '// &
            & 'other: write a group for each with the bodies that touch it', source)
        end associate
        if (allocated(error)) return
      end do
    end subroutine check_rigid_ones
  end subroutine check_contact

end module pd_scene_content_check_contact
